"""`lindy doctor`: is this vehicle, with the board and the instruments in it, fit to be flown?

visit           a visit at a board: what is asked, in which order, and what it answers
board_checks    what a vehicle file tells by itself, and what a board answered, as findings
instrument_checks  what the instruments of a stack say
command         the verb
"""
