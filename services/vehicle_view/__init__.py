"""The vehicle as a pilot sees it: one model that every screen renders. Pure but for io.

ages       from when on what is shown counts as old, and from when on it is not shown any more
view       the vehicle at one instant, from the newest messages
words      the sentences for it, the gravest first, and the lines of a window
log_lines  log lines with their time; a repeated line is one line that counts
io         the ports of a screen
"""
