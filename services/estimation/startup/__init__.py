"""What is learnt while the vehicle lies still: gyroscope bias, atmosphere, north.
Builds on attitude; the top of the service decides when the time at rest is over.
"""
