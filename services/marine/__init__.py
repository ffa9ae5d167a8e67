"""Shared physics: pure functions on plain floats, with their sources. And the time in a picture,
for what writes it and what reads it."""
