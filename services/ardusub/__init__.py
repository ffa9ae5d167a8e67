"""A vehicle whose board runs ArduSub: the six axes of its MANUAL mode down, its telemetry up.

    core           the board as a state machine: packets and commands in, packets and samples out
    introduction   a board is checked before it is listened to: version, parameters, clock
    authority      who has the vehicle: Lindy, or somebody else at the same board
    thrust_path    thruster commands to the sticks for them
    measurements   telemetry asked for, put on our clock
    outbox         what all of these have for others
    parameters     what the board's parameters may be, and had better be
    streams        the telemetry asked for, and its rates
    readings       telemetry to samples, and which messages bring a new one
    board_clock    the board's clock against ours
    mixer, frames  a force for each thruster to ArduSub's axes and their channels

See docs/ardusub.md, and docs/decisions.md for what is fed and why.
"""
