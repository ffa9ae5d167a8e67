"""A double of ArduSub for tests and the bench: what a driver can tell of it, from measured facts.

    settings    the parameters, under the names of 4.5 and of 4.8
    motors      inputs to motor pulses: mixer, saturation, spool time
    telemetry   messages from the simulated vehicle
    board       the board: overrides, modes, arming, failsafes, streams, parameters
    cable       the board and the driver, packet by packet
    memory      the board on virtual time
    udp         the board as a process on 127.0.0.1

The facts were measured on ArduSub 4.5.0-beta1 and 4.8.0-dev on their own simulator board. The
vehicle below the motors is Lindy's simulator. No code of ArduSub is in it.
"""
