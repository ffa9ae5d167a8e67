"""What the drivers of instruments share: is it there, and where a report begins and ends.

watch        does it answer, does it measure, and which of two is used
lines        lines in a stream of bytes
fixes        latitude and longitude as metres north and east of an origin
io.shell     a driver on its port and on the bus
"""
