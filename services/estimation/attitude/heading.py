"""The two headings: one for control, without magnetometer, and one for navigation, with it.

Iron nearby deflects the compass by tens of degrees. On the pilot's screen that is a nuisance; in
the control loop it turns the vehicle (Andrén 2023, section 5.3.2).
"""

from math import atan2, degrees, exp, hypot, pi, radians, remainder, sqrt

from messages import events, topics
from messages.events import Row
from messages.units import Quaternion, Vec3
from services.estimation.attitude.attitude_filter import AttitudeSettings
from services.marine.attitude import down_in_body

LEAST_HORIZONTAL = 2e-6  # [T] less horizontal field than this has no usable direction
PERIOD = 1.0 / topics.IMU.hz  # [s] a gyroscope sampled half as often drifts twice as fast
LEAST_EARTH, MOST_EARTH = 20.0, 70.0  # [µT] the Earth's field is 22 to 67 µT
FIELD_TOLERANCE, DIP_TOLERANCE = 4.0, 5.0  # [µT], [deg] of the normal field
HOLD_OFF = 3.0  # [s] normal field before the compass is used again
YAW_RATE_CUTOFF = 8.0  # [Hz] of the exponential low-pass
COMPASS_TIME = 10.0  # [s] time constant of the filter
COMPASS_GATE = 10.0  # [deg] from the gyroscope
RELEARN = 120.0  # [s] a field unchanged for so long is the new normal one
ROUGH_DRIFT = 0.02  # [rad/s] of a gyroscope that has not rested
UNKNOWN_TURN = 0.5  # [rad/s] possible rate of turn without IMU samples


def wrapped(angle: float) -> float:
    """The same angle [rad] in (-π, π]."""
    angle = remainder(angle, 2.0 * pi)
    return pi if angle <= -pi else angle


class ControlHeading:
    """Yaw of the gyroscope's attitude, accumulated past ±π, and the rate about the body's z."""

    __slots__ = ("_drift", "_usual", "_yaw", "heading", "lag", "std", "yaw_rate")

    def __init__(self, settings: AttitudeSettings, heading: float, std: float) -> None:
        self._drift = self._usual = settings.heading_drift  # [rad/s]
        self.heading = heading  # [rad]
        self.std = std  # [rad]
        self.yaw_rate = 0.0  # [rad/s]
        self.lag = 0.0  # [rad/s] newest sample minus `yaw_rate`
        self._yaw = wrapped(heading)

    def step(self, yaw: float, rate: float, dt: float, noise: float = 0.0) -> None:
        """Take in yaw [rad] of the attitude and rate [rad/s] about z, `dt` [s] later; `noise`
        [rad²/s²]: variance of the rate."""
        self.heading += wrapped(yaw - self._yaw)
        self._yaw = yaw
        self.yaw_rate += (1.0 - exp(-2.0 * pi * YAW_RATE_CUTOFF * dt)) * (rate - self.yaw_rate)
        self.lag = rate - self.yaw_rate
        self.std = _drifted(self.std, self._drift, dt, noise)

    def begin_roughly(self) -> None:
        """Counts turns from here on, with a bias about the vertical that is not known."""
        self._drift, self.std = ROUGH_DRIFT, 0.0

    def calibrated(self) -> None:
        """It is."""
        self._drift = self._usual

    def turn(self, by: float, std: float) -> None:
        """The heading is this much [rad] further, and known to `std` [rad]."""
        self.heading += by
        self._yaw = wrapped(self._yaw + by)
        self.std = std

    def blind(self, seconds: float) -> None:
        """No IMU samples for this long [s]."""
        self.std = min(pi, self.std + UNKNOWN_TURN * seconds)


def _drifted(std: float, drift: float, dt: float, noise: float) -> float:
    """[rad] of a heading after `dt` [s]."""
    steady = drift * dt * max(1.0, dt / PERIOD)
    return min(pi, sqrt(std * std + noise * dt * dt) + steady)


class Compass:
    """The offset from control heading to navigation heading.

    A complementary filter: high frequencies from the gyroscope, low ones from the magnetometer,
    which is ignored while the field is not the Earth's. North is magnetic north.
    """

    __slots__ = (
        "_drift", "_least_std", "field", "innovation", "measured", "offset", "ratio", "std",
    )  # fmt: skip

    def __init__(self, settings: AttitudeSettings) -> None:
        self._drift = settings.heading_drift
        self._least_std = settings.compass_std
        self.field = MagneticField(settings)
        self.offset: float | None = None  # [rad] navigation minus control; None: never measured
        self.std = settings.compass_std  # [rad]
        self.measured = self.innovation = 0.0  # [rad] newest offset, and its distance from `offset`
        self.ratio = 0.0  # [-] squared deviation of that or of the field to its limit

    def step(self, q: Quaternion, field: Vec3, dt: float) -> Row | None:
        """A field [T] in FRD, `dt` [s] after the previous one, with the control attitude q_NB.
        Returns an event to tell; `field.trusted` says whether it was used."""
        north, east = horizontal(q, field)
        level = hypot(north, east)
        if level < LEAST_HORIZONTAL:
            return events.STEEP
        measured, down = -atan2(east, north), down_along(q, field)
        strength, dip = 1e6 * hypot(level, down), atan2(down, level)
        innovation = 0.0 if self.offset is None else wrapped(measured - self.offset)
        # An uncertain heading widens the gate.
        gate = max(radians(COMPASS_GATE), 3.0 * (self.std - self._least_std))
        self.measured, self.innovation = measured, innovation
        event = self.field.judge(strength, dip, measured, innovation, gate, dt)
        self.ratio = max((innovation / gate) ** 2, self.field.ratio)
        if not self.field.trusted:
            return event
        if self.offset is None or abs(innovation) > gate:
            self.offset, self.std = wrapped(measured), self._least_std
        else:
            share = 1.0 - exp(-dt / COMPASS_TIME)
            self.offset = wrapped(self.offset + share * innovation)
            self.std += share * (self._least_std - self.std)
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

    def drift(self, dt: float, noise: float = 0.0) -> None:
        """Advance by `dt` [s] on the gyroscope alone, whose rate has this variance [rad²/s²]."""
        self.std = _drifted(self.std, self._drift, dt, noise)

    def blind(self, seconds: float) -> None:
        """No IMU samples for this long [s]."""
        self.std = min(pi, self.std + UNKNOWN_TURN * seconds)


class MagneticField:
    """Decides for every sample whether the compass may be used: at one place the Earth's field has
    a constant strength, dip and direction, and iron nearby changes at least one of strength, dip
    and agreement with the gyroscope.

    The normal field is the one learnt at calibration, or the one in the settings. After a
    disturbance the compass is used again once the field has been normal for `HOLD_OFF`. A
    disturbance that stays constant for `RELEARN` becomes the new normal, unless the settings
    give the field: a vehicle that stays near iron cannot be told from one that has left the iron at
    its calibration site.
    """

    def __init__(self, settings: AttitudeSettings) -> None:
        self._settings = settings
        self.strength = settings.earth_field  # [µT] normal
        self.dip = None if settings.earth_dip is None else radians(settings.earth_dip)  # [rad]
        self.trusted = False
        # [-] squared distance from the normal field to the largest allowed; 0: none is known
        self.ratio = 0.0
        self._good_for = 0.0  # [s] normal so far, after a disturbance
        self._steady_for = 0.0  # [s] the same so far, though not normal
        self._first = (0.0, 0.0, 0.0)  # strength, dip, bearing when that began
        self._counted = False  # this disturbance has been counted

    @property
    def disturbed(self) -> bool:
        """The field is not the normal one, or has not been for long: the compass is not used."""
        return self._counted and not self.trusted

    def learn(self, strength: float, dip: float) -> bool:
        """Set the normal field [µT, rad], measured at rest. False: it cannot be the Earth's."""
        if not self._can_be_the_earths(strength, dip):
            self._counted = True
            return False
        if self._settings.earth_field is None:
            self.strength = strength
        if self._settings.earth_dip is None:
            self.dip = dip
        self.trusted, self._counted = True, False
        return True

    def judge(
        self, strength: float, dip: float, bearing: float, innovation: float, gate: float, dt: float
    ) -> Row | None:
        """One sample, `dt` [s] after the previous one; `innovation` [rad] is its difference from
        the gyroscope's north, `gate` [rad] the largest allowed. Returns an event to tell;
        `trusted` then says whether the sample may be used."""
        self.ratio = 0.0
        if self.strength is not None and self.dip is not None:
            off, tilt = (strength - self.strength) / FIELD_TOLERANCE, degrees(dip - self.dip)
            self.ratio = max(off * off, (tilt / DIP_TOLERANCE) ** 2)
        if self.is_normal(strength, dip) and abs(innovation) <= gate:
            self._steady_for = 0.0
            if not self.trusted:
                self._good_for += dt
                self.trusted = self._good_for >= HOLD_OFF
                self._counted = self._counted and not self.trusted
            return None
        self._good_for, self.trusted = 0.0, False
        if self._is_new_normal(strength, dip, bearing, dt):
            self.learn(strength, dip)
            return events.LEARNT
        unknown = self.strength is None or self.dip is None
        if self._counted or (unknown and self._can_be_the_earths(strength, dip)):
            return None
        self._counted = True
        return events.DISTURBED

    def is_normal(self, strength: float, dip: float) -> bool:
        """Are strength [µT] and dip [rad] those of the normal field?"""
        if self.strength is None or self.dip is None:
            return False
        return (
            abs(strength - self.strength) <= FIELD_TOLERANCE
            and abs(degrees(dip - self.dip)) <= DIP_TOLERANCE
        )

    def _is_new_normal(self, strength: float, dip: float, bearing: float, dt: float) -> bool:
        first = self._first
        same = (
            abs(strength - first[0]) <= FIELD_TOLERANCE
            and abs(degrees(dip - first[1])) <= DIP_TOLERANCE
            and abs(degrees(bearing - first[2])) <= COMPASS_GATE
        )
        if not same or not self._can_be_the_earths(strength, dip):
            self._first, self._steady_for = (strength, dip, bearing), 0.0
            return False
        self._steady_for += dt
        never = self.strength is None or self.dip is None
        return self._steady_for >= (HOLD_OFF if never else RELEARN)

    def _can_be_the_earths(self, strength: float, dip: float) -> bool:
        s = self._settings
        if s.earth_field is not None and abs(strength - s.earth_field) > FIELD_TOLERANCE:
            return False
        if s.earth_dip is not None and abs(degrees(dip) - s.earth_dip) > DIP_TOLERANCE:
            return False
        return LEAST_EARTH <= strength <= MOST_EARTH


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
