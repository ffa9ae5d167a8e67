"""MAVLink as every service here speaks it: packets and numbers; frames, sockets and cables in io/.

numbers      numbers of the protocol
packet       a message as plain values
framing      where frames begin and end in a stream of bytes
io.codec     frames to packets and back, by pymavlink
io.links     bytes by UDP, TCP and serial port
io.endpoint  packets over links
"""
