"""The same sticks given to Lindy and to ArduSub's own depth hold, on the simulator that comes with
ArduSub's firmware: how far each rises or sinks back after a full stick is let go.

The firmware is found by the environment variable LINDY_ARDUSUB. Each flight is in real time:

    python -m lindy_research.ardusub_comparison --out docs/ardusub
"""
