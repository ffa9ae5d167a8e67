"""Sounds the link from the topside: the two clocks, the latency budget, the alarm."""
