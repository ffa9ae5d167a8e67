"""How many drones a network of Zenoh routers carries: a model fitted to synthetic drones, and what
it says of 100 and 1,000 of them. `model` and `page` are pure; `measure` runs routers.
"""
