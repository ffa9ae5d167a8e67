"""From a wrench to thruster commands, and thrusters watched against a model of themselves.
Imports no other room; the top of the service asks it for what the thrusters can do.
"""
