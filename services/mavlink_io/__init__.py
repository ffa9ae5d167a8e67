"""MAVLink as every service here speaks it: packets and numbers; frames, sockets and cables in io/.

packet       a message as plain values, and numbers of the protocol
io.links     bytes by UDP, TCP and serial port
io.endpoint  packets over links: frames to packets and back, by pymavlink
"""
