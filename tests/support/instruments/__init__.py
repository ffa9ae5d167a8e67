"""Doubles of instruments, from their makers' protocol pages alone: what each says is a function of
(truth, seed, time, faults), and speaks on 127.0.0.1 or a pseudo-terminal.

    truth     what the vehicle does, as an instrument sees it
    dvl       Water Linked DVL A50 and A125
    ping1d    Blue Robotics Ping1D
    gnss      a receiver that speaks NMEA 0183
    ugps      Water Linked Underwater GPS G2
    ports     a TCP server, a pseudo-terminal, an HTTP server
"""
