"""Many drones on one network: which are there, and their names.
`look` asks the network who is there, `meeting` says where both sides meet.
"""
