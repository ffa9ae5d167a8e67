"""The bus: envelopes, Zenoh with its QoS and access control, and a bus in memory.
Builds on config. Only nodes and hosts import it.
"""
