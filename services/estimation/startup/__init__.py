"""Calibration at rest: gyroscope bias, atmosphere, north.
Builds on attitude; the top of the service switches from calibration to running.
"""
