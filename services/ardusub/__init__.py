"""A vehicle whose board runs ArduSub: the six axes of its MANUAL mode down, its telemetry up.

    core         the board as a state machine: packets and commands in, packets and samples out
    board_check  a board is checked before it is listened to: version, parameters, clock
    authority    who has the vehicle: Lindy, or somebody else at the same board
    commands     thruster commands to the sticks for them, and outputs to servos
    mixing       a force for each thruster to ArduSub's axes and their channels
    telemetry    what the board measures: asked for, put on our clock, made samples of
    settings     the table [ardusub], and what all of these have for others

See docs/ardusub.md, and docs/decisions.md for what is fed and why.
"""
