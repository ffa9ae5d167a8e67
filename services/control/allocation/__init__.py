"""From a wrench to thruster commands.
Imports no other room; used by the top of the service.
"""
