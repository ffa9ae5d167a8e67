"""What runs a service: one process each, or any number on virtual time, punctual or with jitter.
Builds on node. Launch and the tools come in.
"""
