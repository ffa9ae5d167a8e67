"""What the motors do when a service of Lindy's is killed in mid-dive: the stack as processes,
ArduSub's own firmware in its simulator, and the outputs as the board reports them, by its clock.

The firmware is found by the environment variable LINDY_ARDUSUB. Each kill takes half a minute:

    python -m lindy_research.ardusub_kills
"""
