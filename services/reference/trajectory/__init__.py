"""Laws of motion along one coordinate or a few together: minimum-jerk velocity references,
position moves, emergency stops, a clock that waits. Pure; imports nothing of the other rooms.
For everybody: paths and guidance build on it, the predictor runs the same law topside.
"""
