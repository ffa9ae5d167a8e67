"""Attitude by Madgwick's filter for gyroscope and accelerometer (Madgwick 2010, section 3.2).

The gyroscope rotates the quaternion; a small gradient descent step then tilts it towards the
accelerometer's down. The step never rotates about the vertical, so heading comes from the gyroscope
alone. Andrén 2023, eq. 4.22 to 4.25, is this filter, printed there without dt on the step and
without normalisation, which both belong to it.

q_NB is w, x, y, z and turns body (FRD) vectors into NED. Roll is about x and pitch about y;
Andrén's eq. 5.24 has the same expressions with these two names exchanged.
"""

from math import atan2, cos, sin, sqrt
from typing import Annotated

import msgspec

from messages.units import Quaternion, Vec3, WithinAnHour
from services.marine.attitude import down_in_body, from_euler
from services.marine.vehicle import GRAVITY

CorrectionRate = Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]
UpToTen = Annotated[float, msgspec.Meta(gt=0.0, le=10.0)]


class AttitudeSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Attitude and headings."""

    # Madgwick's β: fastest step towards the accelerometer. In a turn under way the accelerometer
    # is off by up to 5°, and the tilt error this causes disturbs the heading too: in simulated
    # dives 0.02 rad/s costs 1.4° of tilt and 0.2 °/min of heading, 0.002 a third and nothing. A
    # gyroscope's bias needs no more than ten times itself, which is 0.0005 rad/s.
    correction: CorrectionRate = 0.002  # [rad/s]
    recovery: CorrectionRate = 0.02  # [rad/s] while the tilt's std is above 0.04 rad
    gravity_tolerance: UpToTen = 0.5  # [m/s²] | |f| - g | beyond it: accelerating, no correction
    # [rad] of roll and pitch while corrected: 10 mg of the accelerometer.
    tilt_std: UpToTen = 0.010
    tilt_drift: UpToTen = 0.001  # [rad/s] growth of that while not corrected
    heading_std: UpToTen = 0.002  # [rad] of the control heading while pitching, without drift
    heading_drift: UpToTen = 7e-5  # [rad/s] growth of the control heading's std; 0.25 deg/min
    # [rad/s] at rest; what the low-pass lags behind by is added.
    yaw_rate_std: UpToTen = 0.0006
    yaw_rate_cutoff: UpToTen = 8.0  # [Hz] of the exponential low-pass
    compass_time: Annotated[float, msgspec.Meta(gt=0.0, le=1e3)] = 10.0  # [s] filter time constant
    # [rad] of the navigation heading: 0.2 µT of iron left, and at a dip of 73° three times
    # `tilt_std`. More iron: calibrate, or state more.
    compass_std: UpToTen = 0.033
    compass_gate: Annotated[float, msgspec.Meta(ge=2.0, le=180.0)] = 10.0  # [deg] from gyroscope
    compass_hold_off: WithinAnHour = 3.0  # [s] normal field before the compass is used again
    field_tolerance: Annotated[float, msgspec.Meta(gt=0.0, le=50.0)] = 4.0  # [µT] of strength
    dip_tolerance: Annotated[float, msgspec.Meta(gt=0.0, le=90.0)] = 5.0  # [deg]
    field_relearn: WithinAnHour = 120.0  # [s] a field this long unchanged is the new normal
    earth_field: Annotated[float, msgspec.Meta(ge=20.0, le=70.0)] | None = None  # [µT] None: learn
    earth_dip: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)] | None = None  # [deg] + is down


class AttitudeFilter:
    """The attitude q_NB."""

    __slots__ = ("_beta", "_tolerance", "levelled", "q")

    def __init__(self, settings: AttitudeSettings) -> None:
        self._beta = settings.correction
        self._tolerance = settings.gravity_tolerance
        self.q: Quaternion = (1.0, 0.0, 0.0, 0.0)
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

    def step(self, rate: Vec3, specific_force: Vec3, dt: float, beta: float | None = None) -> bool:
        """Advance by `dt` [s] with the angular rate [rad/s], bias removed, and the specific force
        [m/s²], both in FRD; `beta` [rad/s] replaces `correction`. False: accelerating too much, the
        accelerometer was not used."""
        self.q, self.levelled = turned(self.q, rate, dt), (0.0, 0.0)
        fx, fy, fz = specific_force
        size = sqrt(fx * fx + fy * fy + fz * fz)
        if abs(size - GRAVITY) > self._tolerance:
            return False
        # At rest the specific force points up.
        before = self.q
        self.q = corrected(before, (-fx / size, -fy / size, -fz / size), (beta or self._beta) * dt)
        self.levelled = turn_between(before, self.q)
        return True


def turned(q: Quaternion, rate: Vec3, dt: float) -> Quaternion:
    """q_NB after turning at `rate` [rad/s], body, for `dt` [s] (Madgwick 2010, eq. 11 to 13)."""
    w, x, y, z = q
    half = 0.5 * dt
    a, b, c = half * rate[0], half * rate[1], half * rate[2]
    return unit(
        w - x * a - y * b - z * c,
        x + w * a + y * c - z * b,
        y + w * b - x * c + z * a,
        z + w * c + x * b - y * a,
    )


def turn_between(before: Quaternion, after: Quaternion) -> tuple[float, float]:
    """[rad] About north and east, of the small turn from one q_NB to another: twice the vector part
    of `after` times the inverse of `before`."""
    (a, b, c, d), (w, x, y, z) = before, after
    return 2.0 * (x * a - w * b + z * c - y * d), 2.0 * (y * a - w * c + x * d - z * b)


def corrected(q: Quaternion, down: Vec3, step: float) -> Quaternion:
    """q_NB after one step [rad] of steepest descent towards the unit vector `down`, measured in
    the body (Madgwick 2010, eq. 25, 26 and 33)."""
    w, x, y, z = q
    ex, ey, ez = down_in_body(q)
    ex, ey, ez = ex - down[0], ey - down[1], ez - down[2]
    gw = 2.0 * (x * ey - y * ex)
    gx = 2.0 * (z * ex + w * ey - 2.0 * x * ez)
    gy = 2.0 * (z * ey - w * ex - 2.0 * y * ez)
    gz = 2.0 * (x * ex + y * ey)
    slope = sqrt(gw * gw + gx * gx + gy * gy + gz * gz)
    if slope < 1e-12:
        return q
    # A quarter of the slope is the full correction: a longer step would overshoot.
    k = min(step, slope / 4.0) / slope
    return unit(w - k * gw, x - k * gx, y - k * gy, z - k * gz)


def unit(w: float, x: float, y: float, z: float) -> Quaternion:
    size = sqrt(w * w + x * x + y * y + z * z)
    return w / size, x / size, y / size, z / size


def tilt_of(specific_force: Vec3) -> tuple[float, float]:
    """Roll and pitch [rad] at which a body at rest measures this specific force [m/s²], FRD."""
    fx, fy, fz = specific_force
    return atan2(-fy, -fz), atan2(fx, sqrt(fy * fy + fz * fz))
