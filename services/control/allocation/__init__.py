"""From a wrench to thruster commands, and monitoring of the thrusters against a model.
Imports no other room; used by the top of the service.
"""
