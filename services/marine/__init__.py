"""Shared physics: pure functions on plain floats, every one cites its equation."""
