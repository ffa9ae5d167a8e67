"""Doubles of instruments, from their makers' protocol pages alone: what each says is a function of
(truth, seed, time, faults), and speaks on 127.0.0.1.

    truth     what the vehicle does, as an instrument sees it
    dvl       Water Linked DVL A50 and A125
    ports     a TCP server
"""
