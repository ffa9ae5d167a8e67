"""The attitude from gyroscope and accelerometer.

The gyroscope turns the quaternion; a share of the angle to the accelerometer's down then tilts it
there (Mahony et al. 2008, eq. 48). That never turns about the vertical, so heading comes from the
gyroscope alone. How large a share: tilt_spread.py.

q_NB is w, x, y, z and turns body (FRD) vectors into NED. Roll is about x and pitch about y;
Andrén's eq. 5.24 has the same expressions with these two names exchanged.
"""

from math import atan2, cos, sin, sqrt
from typing import Annotated, Any

import msgspec

from messages.units import Quaternion, Vec3
from services.marine.attitude import down_in_body, from_euler
from services.marine.vehicle import GRAVITY

LEAST_FORCE = 1.0  # [m/s²] less has no direction
UpToTen = Annotated[float, msgspec.Meta(gt=0.0, le=10.0)]


class AttitudeSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Attitude and headings."""

    gravity_tolerance: UpToTen = 0.5  # [m/s²] | |f| - g | at rest; beyond it the IMU is wrong
    # [rad] of roll and pitch while corrected: 10 mg of the accelerometer.
    tilt_std: UpToTen = 0.010
    heading_drift: UpToTen = 7e-5  # [rad/s] growth of the control heading's std; 0.25 deg/min
    # [rad/s] at rest; what the low-pass lags behind by is added.
    yaw_rate_std: UpToTen = 0.0006
    # [rad] of the navigation heading: 0.2 µT of iron left, and at a dip of 73° three times
    # `tilt_std`. More iron: calibrate, or state more.
    compass_std: UpToTen = 0.033
    earth_field: Annotated[float, msgspec.Meta(ge=20.0, le=70.0)] | None = None  # [µT] None: learn
    earth_dip: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)] | None = None  # [deg] + is down


class AttitudeFilter:
    """The attitude q_NB."""

    __slots__ = ("force", "levelled", "q")

    def __init__(self) -> None:
        self.q: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self.force = GRAVITY  # [m/s²] magnitude of the newest specific force
        # [rad] About north and east: by how much the accelerometer turned it in the last step.
        self.levelled = (0.0, 0.0)

    def start(self, specific_force: Vec3, heading: float) -> None:
        """Begin with the tilt of a specific force at rest [m/s²], FRD, and a heading [rad]."""
        roll, pitch = tilt_of(specific_force)
        self.q = from_euler(roll, pitch, heading)

    def turn(self, by: float) -> None:
        """Turn about the vertical by this angle [rad]."""
        (w, x, y, z), c, s = self.q, cos(by / 2.0), sin(by / 2.0)
        self.q = unit(c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w)

    def step(self, rate: Vec3, specific_force: Vec3, dt: float, share: float, most: float) -> Vec3:
        """Advance by `dt` [s] with the angular rate [rad/s], bias removed, and the specific force
        [m/s²], both in FRD.

        Args:
            share: [-] of the deviation from the accelerometer's down that is corrected.
            most: [rad] a larger deviation counts as that.

        Returns:
            The deviation that was corrected, before its share [rad], as a turn of the body.
        """
        self.q, self.levelled = turned(self.q, rate, dt), (0.0, 0.0)
        fx, fy, fz = specific_force
        self.force = size = sqrt(fx * fx + fy * fy + fz * fz)
        if size < LEAST_FORCE:
            return 0.0, 0.0, 0.0
        # At rest the specific force points up. Measured down crossed with the attitude's.
        x, y, z = down_in_body(self.q)
        ex, ey, ez = (fz * y - fy * z) / size, (fx * z - fz * x) / size, (fy * x - fx * y) / size
        off = sqrt(ex * ex + ey * ey + ez * ez)
        cosine = -(fx * x + fy * y + fz * z) / size
        angle = atan2(off, cosine)
        if off > 0.0:
            scale = min(angle, most) / off
            ex, ey, ez = scale * ex, scale * ey, scale * ez
        a, b, c, d = before = self.q
        self.q = turned(before, (ex, ey, ez), share)
        # Twice the vector part of this attitude times the inverse of the one before.
        w, x, y, z = self.q
        self.levelled = 2.0 * (x * a - w * b + z * c - y * d), 2.0 * (y * a - w * c + x * d - z * b)
        return ex, ey, ez


def turned(q: Quaternion, rate: Vec3, dt: float) -> Quaternion:
    """q_NB after turning at `rate` [rad/s], body, for `dt` [s] (Madgwick 2010, eq. 11 to 13)."""
    return unit(*turned_longer(q, rate, dt))


def turned_longer(q: Any, rate: Any, dt: Any) -> Any:
    """The same before it is made a unit quaternion; numbers, or arrays of them."""
    w, x, y, z = q
    half = 0.5 * dt
    a, b, c = half * rate[0], half * rate[1], half * rate[2]
    return (
        w - x * a - y * b - z * c,
        x + w * a + y * c - z * b,
        y + w * b - x * c + z * a,
        z + w * c + x * b - y * a,
    )


def unit(w: float, x: float, y: float, z: float) -> Quaternion:
    size = sqrt(w * w + x * x + y * y + z * z)
    return w / size, x / size, y / size, z / size


def tilt_of(specific_force: Vec3) -> tuple[float, float]:
    """Roll and pitch [rad] at which a body at rest measures this specific force [m/s²], FRD."""
    fx, fy, fz = specific_force
    return atan2(-fy, -fz), atan2(fx, sqrt(fy * fy + fz * fz))
