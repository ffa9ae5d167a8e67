"""Runs the drone's reference ahead over the commands on the way: where it is by now."""
