"""MAVLink as every service here speaks it: packets, numbers; frames, sockets and cables in io/."""
