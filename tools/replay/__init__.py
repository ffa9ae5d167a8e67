"""Playing a recorded dive again: onto a bus, in its own time, or through one service, to compare
what today's code makes of it."""
