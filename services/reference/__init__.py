"""Pilot intent becomes a smooth reference: minimum-jerk velocity references, on board."""
