"""Which samples may be used: range checks, silent, frozen and noisy sensors.
Imports no other room; every sample passes here before an observer sees it.
"""
