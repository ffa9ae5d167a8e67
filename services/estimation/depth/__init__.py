"""Depth and its rate from pressure and the accelerometer: the observers, outliers, late samples.
Imports no other room; only the top of the service imports it.
"""
