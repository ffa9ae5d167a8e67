"""Starts a stack on this machine and keeps it running: hubs, children, supervision.
The highest room of the runtime. Only the tools import it.
"""
