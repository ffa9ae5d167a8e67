"""The connection of a pilot to a node."""
