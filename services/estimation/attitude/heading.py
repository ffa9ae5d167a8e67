"""The two headings: one for control, without magnetometer, and one for navigation, with it.

Iron nearby deflects the compass by tens of degrees. On the pilot's screen that is a nuisance; in
the control loop it turns the vehicle (Andrén 2023, section 5.3.2).
"""

from math import atan2, exp, hypot, pi, radians, remainder

from messages import topics
from messages.units import Quaternion, Vec3
from services.estimation.attitude.attitude_filter import AttitudeSettings
from services.estimation.attitude.magnetic_field import MagneticField
from services.marine.attitude import down_in_body

LEAST_HORIZONTAL = 2e-6  # [T] less horizontal field than this has no usable direction
PERIOD = 1.0 / topics.IMU.hz  # [s] a gyroscope sampled half as often drifts twice as fast
UNKNOWN_TURN = 0.5  # [rad/s] possible rate of turn without IMU samples


def wrapped(angle: float) -> float:
    """The same angle [rad] in (-π, π]."""
    angle = remainder(angle, 2.0 * pi)
    return pi if angle <= -pi else angle


class ControlHeading:
    """Yaw of the gyroscope's attitude, accumulated past ±π, and the rate about the body's z."""

    __slots__ = ("_cutoff", "_drift", "_yaw", "heading", "lag", "std", "yaw_rate")

    def __init__(self, settings: AttitudeSettings, heading: float, std: float) -> None:
        self._cutoff = 2.0 * pi * settings.yaw_rate_cutoff
        self._drift = settings.heading_drift
        self.heading = heading  # [rad]
        self.std = std  # [rad]
        self.yaw_rate = 0.0  # [rad/s]
        self.lag = 0.0  # [rad/s] newest sample minus `yaw_rate`
        self._yaw = wrapped(heading)

    def step(self, yaw: float, rate: float, dt: float) -> None:
        """Take in yaw [rad] of the attitude and rate [rad/s] about z, `dt` [s] later."""
        self.heading += wrapped(yaw - self._yaw)
        self._yaw = yaw
        self.yaw_rate += (1.0 - exp(-self._cutoff * dt)) * (rate - self.yaw_rate)
        self.lag = rate - self.yaw_rate
        self.std = min(pi, self.std + self._drift * dt * max(1.0, dt / PERIOD))

    def turn(self, by: float, std: float) -> None:
        """The heading is this much [rad] further, and known to `std` [rad]."""
        self.heading += by
        self._yaw = wrapped(self._yaw + by)
        self.std = std

    def blind(self, seconds: float) -> None:
        """No IMU samples for this long [s]."""
        self.std = min(pi, self.std + UNKNOWN_TURN * seconds)


class Compass:
    """The offset from control heading to navigation heading.

    A complementary filter: high frequencies from the gyroscope, low ones from the magnetometer,
    which is ignored while the field is not the Earth's. North is magnetic north.
    """

    __slots__ = ("_drift", "_gate", "_least_std", "_time", "field", "offset", "std")

    def __init__(self, settings: AttitudeSettings) -> None:
        self._time = settings.compass_time
        self._drift = settings.heading_drift
        self._least_std = settings.compass_std
        self._gate = radians(settings.compass_gate)
        self.field = MagneticField(settings)
        self.offset: float | None = None  # [rad] navigation minus control; None: never measured
        self.std = settings.compass_std  # [rad]

    def step(self, q: Quaternion, field: Vec3, dt: float) -> str | None:
        """A field [T] in FRD, `dt` [s] after the previous one, with the control attitude q_NB.
        Returns an event to count; `field.trusted` says whether it was used."""
        north, east = horizontal(q, field)
        level = hypot(north, east)
        if level < LEAST_HORIZONTAL:
            return "steep"
        measured = -atan2(east, north)
        down = down_along(q, field)
        strength, dip = 1e6 * hypot(level, down), atan2(down, level)
        innovation = 0.0 if self.offset is None else wrapped(measured - self.offset)
        # An uncertain heading widens the gate.
        gate = max(self._gate, 3.0 * (self.std - self._least_std))
        event = self.field.judge(strength, dip, measured, innovation, gate, dt)
        if self.field.trusted:
            self._use(measured, innovation, dt, abs(innovation) > gate)
        return event

    def measure(self, q: Quaternion, field: Vec3) -> float | None:
        """[rad] The offset that this field [T], FRD, alone says; None: it is not the normal one."""
        measured = bearing(q, field)
        return measured if self.field.is_normal(*strength_and_dip(q, field)) else None

    def restart(self, offset: float) -> None:
        """From an offset [rad] measured without the gyroscope."""
        self.offset, self.std = offset, self._least_std

    def resume(self, offset: float, strength: float, dip: float) -> None:
        """Restore a checkpoint: offset [rad] and the normal field [µT, rad]."""
        self.offset = wrapped(offset)
        self.field.learn(strength, dip)

    def drift(self, dt: float) -> None:
        """Advance by `dt` [s] on the gyroscope alone."""
        self.std = min(pi, self.std + self._drift * dt * max(1.0, dt / PERIOD))

    def blind(self, seconds: float) -> None:
        """No IMU samples for this long [s]."""
        self.std = min(pi, self.std + UNKNOWN_TURN * seconds)

    def _use(self, measured: float, innovation: float, dt: float, restart: bool) -> None:
        if self.offset is None or restart:
            self.offset, self.std = wrapped(measured), self._least_std
            return
        share = 1.0 - exp(-dt / self._time)
        self.offset = wrapped(self.offset + share * innovation)
        self.std += share * (self._least_std - self.std)


def strength_and_dip(q: Quaternion, field: Vec3) -> tuple[float, float]:
    """Strength [µT] and dip [rad], + is down, of a field [T] in FRD."""
    level, down = hypot(*horizontal(q, field)), down_along(q, field)
    return 1e6 * hypot(level, down), atan2(down, level)


def bearing(q: Quaternion, field: Vec3) -> float | None:
    """[rad] Offset from the yaw of the attitude q_NB to the magnetic heading; for yaw 0, the
    magnetic heading. None: the field [T], FRD, is too steep."""
    north, east = horizontal(q, field)
    return None if hypot(north, east) < LEAST_HORIZONTAL else -atan2(east, north)


def horizontal(q: Quaternion, v: Vec3) -> tuple[float, float]:
    """North and east components of a body vector: the first two rows of R_NB @ v."""
    w, x, y, z = q
    a, b, c = v
    north = (1 - 2 * (y * y + z * z)) * a + 2 * (x * y - w * z) * b + 2 * (x * z + w * y) * c
    east = 2 * (x * y + w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z - w * x) * c
    return north, east


def down_along(q: Quaternion, v: Vec3) -> float:
    """Down component of a body vector: the last row of R_NB @ v."""
    x, y, z = down_in_body(q)
    return x * v[0] + y * v[1] + z * v[2]
