"""Many nominal dives stepped in one set of arrays: the same laws as the services, a lane for each
dive. `lanes.py` says what a lane is, `coverage.py` which dives it knows, `dives.py` flies them."""
