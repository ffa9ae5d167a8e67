"""Many drones on one network: which are there, their names, and a router's configuration.
`roster` and `names` are pure; `look` asks the network.
"""
