"""Shared physics: pure functions on plain floats, with their sources."""
