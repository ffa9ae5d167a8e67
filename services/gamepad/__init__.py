"""Pilot input: a gamepad, the keyboard or a recorded stick log become pilot commands."""
