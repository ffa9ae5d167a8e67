"""Validation of samples: range checks, silent and frozen sensors, wrong rates.
Imports no other room; every sample is validated here before an observer uses it.
"""
