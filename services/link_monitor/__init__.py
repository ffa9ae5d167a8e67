"""Watches the link from both its ends: the two clocks, the latency budget, the alarm."""
