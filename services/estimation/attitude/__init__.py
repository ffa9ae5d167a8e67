"""Attitude from gyroscope and accelerometer, the two headings, and the check of the magnetic field.
Imports no other room; startup, horizontal and the top of the service build on it.
"""
