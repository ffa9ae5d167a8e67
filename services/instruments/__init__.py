"""What the drivers of instruments share: is it there, and where a report begins and ends.

core         does it answer, does it measure, which of two is used; lines in a stream of bytes;
             latitude and longitude as metres north and east of an origin
io.shell     a driver on its port and on the bus
"""
