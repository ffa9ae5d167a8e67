"""What the drone is to do now: modes, sticks, go-to, path following, station keeping, stopping.
Builds on paths and trajectory and gives the reference message; knows no bus and no clock.
Only `reference/core.py` comes in from outside.
"""
