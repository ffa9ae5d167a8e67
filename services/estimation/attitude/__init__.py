"""Attitude from gyroscope and accelerometer, the two headings, and whether the magnetic field can
be trusted. Imports no other room; startup, horizontal and the top of the service build on it.
"""
