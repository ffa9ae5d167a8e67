"""A vehicle whose board runs ArduSub: the six axes of its MANUAL mode down, its telemetry up. The
board as a state machine is in `core`. See docs/ardusub.md."""
