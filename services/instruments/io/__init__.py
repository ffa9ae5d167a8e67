"""A driver on its port and on the bus."""
