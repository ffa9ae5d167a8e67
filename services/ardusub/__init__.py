"""A vehicle whose board runs ArduSub: the six axes of its MANUAL mode down, its telemetry up.

    core           the board as a state machine: packets and commands in, packets and samples out
    introduction   a board is checked before it is listened to: version, parameters, clock
    authority      who has the vehicle: Lindy, or somebody else at the same board
    thrust_path    thruster commands to the sticks for them
    measurements   telemetry asked for, put on our clock
    outbox         what all of these have for others
    parameters     what the board's parameters may be
    advice         … and what they had better not be
    streams        the telemetry asked for, and its rates
    readings       telemetry to samples
    board_updates  which messages bring a new pressure or field, and of when
    board_clock    the board's clock against ours
    mixer, frames  a force for each thruster to ArduSub's axes
    rc_channels    an axis to the pulse of its channel
    framing        MAVLink frames in a stream of bytes
    io             the link, and the codec

See docs/ardusub.md, and docs/decisions for what is fed and why.
"""
