"""Answers the sounder's pings from on board, with the drone's own clock."""
