"""What the drivers of instruments share: is it there, and where a report begins and ends.

watch        does it answer, and how much of it is used
lines        lines in a stream of bytes
io.shell     a driver on its port and on the bus
"""
