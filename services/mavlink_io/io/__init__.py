"""Sockets, serial ports, and MAVLink's frames. The only place that knows pymavlink."""
