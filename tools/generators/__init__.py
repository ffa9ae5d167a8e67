"""Generators that `lindy ramp`, `profile` and `path` show beside the one that is flown."""
