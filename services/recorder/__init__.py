"""Recorder: writes every topic of the vehicle to one MCAP file that any MCAP tool can open."""
