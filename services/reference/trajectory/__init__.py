"""Trajectory generation for one or several coordinates: minimum-jerk velocity references,
position moves, emergency stops. Pure; imports nothing of the other rooms. Paths and
guidance build on it; the predictor runs the same law topside.
"""
