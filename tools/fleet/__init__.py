"""Many drones on one network: which are there, and their names.
`roster` and `names` are pure; `look` asks the network.
"""
