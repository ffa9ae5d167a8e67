"""Is the mean specific force of a rest that of a vehicle at rest?

At rest the specific force has the magnitude of gravity and points up, which in FRD is -z. A turn of
the IMU about the vertical does not show here: neither a wrong sign of x and y together.
"""

from math import acos, degrees, hypot

from messages.units import Vec3
from services.estimation.startup.arrival_check import Finding
from services.marine.vehicle import GRAVITY

# [m/s²] the allowed deviation is the attitude filter's `gravity_tolerance`, beyond which it never
# corrects the tilt: 5 % by default, for ±50 mg of offset or 3 % of scale and 20 mg, as of a cheap
# MEMS accelerometer. However wide that is set, a fifth of gravity is not a sensor's error.
MOST_DEVIATION = 2.0
# [deg] A slipway is steep with 15, a vehicle that leans on its frame or hangs on a corner is below
# 45; one whose IMU is mounted at a right angle to what the vehicle file says reads 90.
MOST_TILT = 60.0
OVERTURNED = 120.0  # [deg] nearer to upside down than to lying on a side
MOUNTING = "check [vehicle.mounting.imu] in the vehicle file and the sign of the IMU's z axis"


def tilt(force: Vec3) -> float:
    """[deg] between the body's down axis and the vertical, at rest."""
    return degrees(acos(max(-1.0, min(1.0, -force[2] / hypot(*force)))))


def wrong_at_rest(force: Vec3, tolerance: float) -> Finding | None:
    """What is wrong with this mean specific force [m/s²], FRD, if its magnitude may differ from
    gravity by `tolerance` [m/s²]."""
    read, band = hypot(*force), min(tolerance, MOST_DEVIATION)
    if abs(read - GRAVITY) > band:
        return Finding(
            "wrong_force:sensor/imu",
            f"the IMU reads a specific force of {read:.2f} m/s² at rest, allowed are "
            f"{GRAVITY - band:.2f} to {GRAVITY + band:.2f}: check the unit and scale of its "
            f"accelerometer, and estimation.attitude.gravity_tolerance",
        )
    if (angle := tilt(force)) <= MOST_TILT:
        return None
    over = angle > OVERTURNED
    lies = "upside down" if over else "on its side or end"
    return Finding(
        "upside_down:sensor/imu" if over else "on_its_side:sensor/imu",
        f"the IMU reads as if the vehicle lay {lies} (z is {force[2]:+.1f} m/s², tilted by "
        f"{angle:.0f} deg, allowed are {MOST_TILT:g}): put the vehicle upright, or {MOUNTING}",
    )
