"""A DVL of Water Linked, the A50 or the A125: its velocity over the ground and its altitude."""
