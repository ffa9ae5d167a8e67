"""A service's end of the bus: ports, gates, timers, requests and answers, checkpoints,
loop statistics. Builds on bus and config. Every `service.py` comes in here, and nowhere deeper.
"""
