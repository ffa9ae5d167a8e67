"""The same sticks given to Lindy and to ArduSub's own modes, on the simulator that comes with
ArduSub's firmware: how far each rises or sinks back after a full stick is let go, what random
sticks do to depth and heading, and how well each holds a place with a DVL against a current.

The firmware is found by the environment variable LINDY_ARDUSUB. Each flight is in real time:

    python -m lindy_research.ardusub_comparison --out docs/ardusub
    python -m lindy_research.ardusub_comparison --drawn 201
    python -m lindy_research.ardusub_comparison --stations
"""
