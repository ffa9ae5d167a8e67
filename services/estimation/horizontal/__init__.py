"""Position, velocity over the ground and current from DVL, USBL and thrust: an extended Kalman
filter, its buffer for late measurements, and the compass deviation. Builds on attitude.
"""
