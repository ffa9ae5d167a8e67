"""Shared by every pilot: a gamepad, a browser, or a ground station. Pure but for io.

sticks          stick positions, and what a stick source reads at one instant
pilot_intents   requests that a pilot can make, and which older ones a newer one withdraws
guest_pilot     a pilot from outside of Lindy: one sender at a time has the sticks
pilot           lease, arming, hand-over and requests, as a state machine
io              what every pilot does on the bus: commands, requests, checkpoint
"""
