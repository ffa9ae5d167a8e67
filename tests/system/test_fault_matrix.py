"""A part of the fault matrix in every run of the tests: goals that hold today go on holding.

The whole of it is `make faults`; docs/faults.md says what misses.
"""
