"""`lindy check-driver`: does a vehicle side keep the promises of every vehicle side?

bench     the vehicle side alone, with somebody who commands its thrusters and hears what it says
rules     one promise a function
command   the verb
"""
