"""Pilot stack for underwater drones. What other programs may use of it is in `lindy.api`."""
