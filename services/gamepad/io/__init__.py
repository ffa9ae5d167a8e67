"""Pads, the keyboard, and the files that a pilot names."""
