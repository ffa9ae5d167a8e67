"""`lindy doctor`: is this vehicle, with the board and the instruments in it, fit to be flown?

file_checks     one line of what was found, and what a vehicle file tells by itself
visit           a visit at a board: what is asked, in which order, and what it answers
board_checks    from what a board answered to findings, and what to set a parameter to
instrument_checks  what the instruments of a stack say
command         the verb
"""
