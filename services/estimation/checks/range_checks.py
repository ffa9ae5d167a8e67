"""Range checks, against broken and saturated sensors.

Ports have already refused NaN and infinities.
"""

from math import hypot

from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)

# [m/s²] less is a dead sensor (a vehicle in water never falls freely); ±16 g parts end at 157.
LEAST_FORCE, MOST_FORCE = 0.5, 156.0
MOST_RATE = 34.8  # [rad/s] ±2000 deg/s parts end at 34.9
LEAST_PRESSURE, MOST_PRESSURE = 50e3, 12e6  # [Pa] from a mountain lake to 1100 m of sea
# [Pa] Outside, the vehicle did not float: from a mountain lake at 3000 m to the highest pressure of
# the air measured below 750 m, 1083.8 hPa (Agata, 1968; WMO archive of extremes). A calibration
# less than 0.7 m under water, in standard air, cannot be told from high pressure.
LEAST_ATMOSPHERE, MOST_ATMOSPHERE = 70e3, 108.4e3
MOST_SPEED = 15.0  # [m/s] over the ground
MOST_DISTANCE = 20e3  # [m] range of acoustic positioning
LEAST_FIELD, MOST_FIELD = 15e-6, 100e-6  # [T] the Earth's is 22 to 67 µT


def imu(sample: ImuSample) -> bool:
    return hypot(*sample.specific_force) >= LEAST_FORCE


def saturated(sample: ImuSample) -> bool:
    """Whether an axis is at the end of its range; the true value is then unknown."""
    fx, fy, fz = sample.specific_force
    p, q, r = sample.angular_rate
    force, rate = max(abs(fx), abs(fy), abs(fz)), max(abs(p), abs(q), abs(r))
    return force >= MOST_FORCE or rate >= MOST_RATE


def pressure(sample: PressureSample) -> bool:
    return LEAST_PRESSURE <= sample.pressure <= MOST_PRESSURE


def magnetometer(sample: MagnetometerSample) -> bool:
    return LEAST_FIELD <= hypot(*sample.field) <= MOST_FIELD


def dvl(sample: DvlSample) -> bool:
    return hypot(*sample.velocity) <= MOST_SPEED and sample.std <= MOST_SPEED


def usbl(sample: UsblSample) -> bool:
    return hypot(sample.north, sample.east) <= MOST_DISTANCE and sample.std <= MOST_DISTANCE


def atmosphere(pressure: float) -> bool:
    """[Pa]"""
    return LEAST_ATMOSPHERE <= pressure <= MOST_ATMOSPHERE
