"""Many drones on one network: which are there, and their names."""
