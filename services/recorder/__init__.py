"""Recorder: every stream of the vehicle into one MCAP file that any MCAP tool can open."""
