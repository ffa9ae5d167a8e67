"""From reference and state to a wrench, and from the wrench to thruster commands."""
