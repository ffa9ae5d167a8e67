"""Failsafes: which conditions are watched, what each makes the drone do, and what ends it."""
