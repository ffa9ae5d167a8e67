"""A service's end of the bus: ports, gates, timers, requests and answers, checkpoints,
loop statistics. Builds on bus and config. Every `service.py` imports from here, and nothing deeper.
"""
