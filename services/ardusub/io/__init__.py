"""The link to the board: sockets, a serial port, and the MAVLink codec."""
