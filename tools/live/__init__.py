"""Shared by `dive`, `up` and `simulate`: the pilot, the screen, the end of a dive, its files."""
