"""Pads, the keyboard and the files a pilot names."""
