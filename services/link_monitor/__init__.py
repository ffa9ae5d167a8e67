"""Measures the link from both ends: clock offset, latency budget, link alarm."""
