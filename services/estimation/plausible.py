"""Which samples can be true at all. What a broken or saturated sensor says is not used.

Ports have already refused NaN and infinities.
"""

from math import hypot

from messages.sensors import ImuSample, MagnetometerSample, PressureSample

# [m/s²] less is a dead sensor (a vehicle in water never falls freely); ±16 g parts end at 157.
LEAST_FORCE, MOST_FORCE = 0.5, 156.0
MOST_RATE = 34.8  # [rad/s] ±2000 deg/s parts end at 34.9
LEAST_PRESSURE, MOST_PRESSURE = 50e3, 12e6  # [Pa] from a mountain lake to 1100 m of sea
LEAST_ATMOSPHERE, MOST_ATMOSPHERE = 70e3, 110e3  # [Pa] beyond: the vehicle did not float
LEAST_FIELD, MOST_FIELD = 15e-6, 100e-6  # [T] the Earth's is 22 to 67 µT


def imu(sample: ImuSample) -> bool:
    if hypot(*sample.specific_force) < LEAST_FORCE:
        return False
    fx, fy, fz = sample.specific_force
    p, q, r = sample.angular_rate
    return max(abs(fx), abs(fy), abs(fz)) < MOST_FORCE and max(abs(p), abs(q), abs(r)) < MOST_RATE


def pressure(sample: PressureSample) -> bool:
    return LEAST_PRESSURE <= sample.pressure <= MOST_PRESSURE


def magnetometer(sample: MagnetometerSample) -> bool:
    return LEAST_FIELD <= hypot(*sample.field) <= MOST_FIELD


def atmosphere(pressure: float) -> bool:
    """[Pa]"""
    return LEAST_ATMOSPHERE <= pressure <= MOST_ATMOSPHERE
