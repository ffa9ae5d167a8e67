"""Hosts run services: one or several in a process, or any number on virtual time, punctual or with
jitter.
Builds on node. Launch and the tools import it.
"""
