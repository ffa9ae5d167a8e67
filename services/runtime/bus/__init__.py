"""The bus: envelopes, Zenoh with its QoS and access control, and the same in memory.
Builds on config. Only nodes and hosts come in.
"""
