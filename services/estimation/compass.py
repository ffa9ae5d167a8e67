"""The compass: north, and whether the field is the Earth's.

Iron nearby deflects a compass by tens of degrees. On the pilot's screen that is a nuisance; in the
control loop it turns the vehicle (Andrén 2023, §5.3.2). So it corrects the angle from the control
heading to north, and its own deviation, and considers everything else (Schmidt 1966). Only where
the gyroscope does not know how the vehicle has turned, and the field has proven steady, does it
correct heading and gyroscope as well.

At one place the Earth's field has a constant strength, dip and direction; iron nearby changes at
least one of them. A disturbance that stays for `RELEARN` becomes the normal field: a vehicle that
stays near iron cannot be told from one that has left the iron at its calibration site.
"""

from math import atan2, degrees, hypot, inf, pi, radians, remainder, sqrt

from messages import events, topics
from messages.events import Event
from messages.units import Vec3
from services.estimation.filter import (
    DEVIATION,
    GYRO,
    NORTH,
    TILT,
    YAW,
    ErrorStateFilter,
    Row,
    considered,
    to_world,
)
from services.estimation.quantity import Fusion, Quantity
from services.estimation.settings import AttitudeSettings

PERIOD_NS = 95_000_000  # [ns] over which the field is averaged
LEAST_LEVEL = 2e-6  # [T] less horizontal field than this has no usable direction
LEAST_EARTH, MOST_EARTH = 20.0, 70.0  # [µT] the Earth's field is 22 to 67 µT
FIELD_TOLERANCE, DIP_TOLERANCE = 4.0, 5.0  # [µT], [deg] of the normal field
GATE = radians(10.0)  # [rad] from the gyroscope
HOLD_OFF = 3.0  # [s] of normal field before the compass is used again
RELEARN = 120.0  # [s] a field unchanged for so long is the new normal one
STEADY, STEADY_S = 2.0, 5.0  # [µT] 1σ of a field that may teach the gyroscope, over [s]
NOISE, LASTS = 0.01, 2.0  # [rad] 1σ of a mean, [s] of what is coloured of `compass_std`
UNKNOWN_NOISE = 0.05  # [rad] 1σ of a mean where the heading is not known
UNKNOWN_BIAS = 1e-3  # [rad/s] 1σ of the gyroscope, beyond which the compass corrects it
UNUSABLE_BIAS, FOUND_BIAS = 0.03, 0.005  # [rad/s] of it: beyond, it measures no turn; found again
LOST, FOUND, WRAPPED, FOUND_S = 0.2, 0.15, 1.0, 0.7  # [rad] 1σ of the heading, [s] of normal field
VALID_NS = 60_000_000_000  # [ns] north stays valid on the gyroscope for this long
BIASES = (GYRO, GYRO + 1, GYRO + 2)


class Compass:
    """Use a sample with `fuse`; both headings' validity is here as well."""

    def __init__(self, settings: AttitudeSettings) -> None:
        self._std = std = settings.compass_std
        self.quantity = Quantity("compass", "rad", NOISE, std, LASTS, 60.0, 5.0)
        self.strength: float | None = None  # [µT] normal
        self.dip: float | None = None  # [rad] normal
        self.knows_north = False
        self.lost = False  # the heading is not known, and a compass may find it
        self.used_ns = 0
        self._trusted = False
        self._told = False  # this disturbance has been told
        self._good_for = 0.0  # [s] normal, after a disturbance
        self._steady_for = 0.0  # [s] not normal, but the same
        self._first = (0.0, 0.0, 0.0)  # strength, dip, bearing when that began
        self._sum: Vec3 = (0.0, 0.0, 0.0)
        self._count, self._since_ns = 0, 0
        self._mean: tuple[float, float] | None = None  # [µT] level and down, over `STEADY_S`
        self._spread = inf  # [µT²]

    @property
    def disturbed(self) -> bool:
        return self._told and not self._trusted

    def learn(self, strength: float, dip: float) -> bool:
        """Set the normal field [µT, rad], measured at rest. False: it cannot be the Earth's."""
        if not LEAST_EARTH <= strength <= MOST_EARTH:
            self._told = True
            return False
        self.strength, self.dip = strength, dip
        self._trusted, self._told = True, False
        return True

    def take_north(self, f: ErrorStateFilter, field: Vec3) -> None:
        """North is where this field, world axes, points. An error of the tilt is one of north as
        well: what corrects the one later corrects the other."""
        n, e, _ = field
        f.north, f.deviation = -atan2(e, n), 0.0
        f.forget(DEVIATION, self._std)
        f.forget(NORTH, pi)
        Ph, explained = f.explained(_row(field))
        f.correct(Ph, explained + NOISE * NOISE, 0.0, considered(NORTH))
        self.knows_north = True
        self.quantity.forget()

    def fuse(self, f: ErrorStateFilter, field: Vec3, stamp_ns: int) -> Event | None:
        """One sample [T], FRD. Returns an event to tell."""
        n, e, d = to_world(f.rotation, field)
        x, y, z = self._sum
        self._sum, self._count = (x + n, y + e, z + d), self._count + 1
        if stamp_ns - self._since_ns < PERIOD_NS:
            return None
        n, e, d = (1e6 * total / self._count for total in self._sum)
        dt = min(0.5, max(0.0, (stamp_ns - self._since_ns) * 1e-9))
        self._sum, self._count, self._since_ns = (0.0, 0.0, 0.0), 0, stamp_ns
        level, quantity = hypot(n, e), self.quantity
        if level < 1e6 * LEAST_LEVEL:
            quantity.refuse(events.STEEP(topics.MAGNETOMETER.key), stamp_ns)
            return events.STEEP(topics.MAGNETOMETER.key)
        self._hear_spread(level, d, dt)
        bearing = -atan2(e, n)
        innovation = remainder(bearing - f.north - f.deviation, 2.0 * pi)
        innovation = innovation if self.knows_north else 0.0
        learning = self.lost or f.std(GYRO + 2) > UNKNOWN_BIAS  # so the gyroscope refutes nothing
        gate = pi if learning else max(GATE, 3.0 * self.north_std(f))
        event = self._judge(hypot(level, d), atan2(d, level), bearing, innovation, gate, dt)
        if not self._trusted:
            why = events.DISTURBED(topics.MAGNETOMETER.key)
            quantity.refuse(why, stamp_ns)
            return event
        self.used_ns = stamp_ns
        if not self.knows_north or abs(innovation) > gate:
            self.take_north(f, (n, e, d))
            return event
        found = self._correct(f, _row((n, e, d)), bearing, innovation, stamp_ns)
        return event or found

    def _correct(
        self, f: ErrorStateFilter, h: Row, bearing: float, innovation: float, stamp_ns: int
    ) -> Event | None:
        quantity = self.quantity
        helps = self._spread < STEADY**2
        corrected = [NORTH, DEVIATION]
        if helps and f.std(GYRO + 2) > UNKNOWN_BIAS:
            corrected += BIASES
        unknown = self.lost or f.std(YAW) > LOST or f.std(GYRO + 2) > FOUND_BIAS
        if helps and unknown:
            if f.std(YAW) > WRAPPED:  # it may be a turn off, and that says nothing of the bias
                f.forget(YAW, pi)
            corrected.append(YAW)
            quantity.coloured, quantity.white_variance = 0.0, UNKNOWN_NOISE**2
        else:
            quantity.coloured = self._std
        if (
            quantity.fuse(f, h, bearing, innovation, stamp_ns, considered(*corrected))
            is not Fusion.USED
        ):
            if self.lost:  # what is known of it does not fit: it begins anew
                f.forget(YAW, pi)
                f.widen(GYRO + 2, UNUSABLE_BIAS)
            return None
        self._good_for = min(HOLD_OFF, self._good_for + min(0.2, quantity.period))
        known = f.std(YAW) < FOUND and f.std(GYRO + 2) < FOUND_BIAS
        if self.lost and known and self._good_for >= FOUND_S:
            self.lost = False
            return events.FOUND_HEADING()
        return None

    def watch(self, f: ErrorStateFilter) -> None:
        """Without a compass, rest alone shows that the gyroscope measures turns again."""
        if not self.knows_north:
            self.lost = self.lost and f.std(GYRO + 2) > FOUND_BIAS

    def unseen(self, f: ErrorStateFilter) -> None:
        """After a silence of the IMU: has the vehicle turned? Without a compass, nothing tells."""
        if self.knows_north and f.std(YAW) > LOST:
            self.lose()
            f.forget(YAW, pi)  # a turn of several 1σ is no outlier

    def lose(self) -> None:
        """The heading is not known."""
        self.lost, self._good_for = True, 0.0

    def is_recent(self, now: int) -> bool:
        return self.knows_north and now - self.used_ns <= VALID_NS

    def north_std(self, f: ErrorStateFilter) -> float:
        """[rad] 1σ of the heading from north."""
        if self.lost:
            return pi
        P = f.P
        total = float(P[NORTH, NORTH] + 2.0 * P[NORTH, YAW] + P[YAW, YAW])
        return min(pi, sqrt(max(0.0, total)))

    def _hear_spread(self, level: float, down: float, dt: float) -> None:
        if self._mean is None:
            self._mean, self._spread = (level, down), 2.0 * STEADY**2
            return
        share, (x, y) = min(0.1, dt / STEADY_S), self._mean
        a, b = level - x, down - y
        self._mean = x + share * a, y + share * b
        seen = min(4.0 * STEADY**2, 0.5 * (a * a + b * b))  # a wrong tilt does not last
        self._spread += share * (seen - self._spread)

    def _judge(
        self, strength: float, dip: float, bearing: float, innovation: float, gate: float, dt: float
    ) -> Event | None:
        """Is this the normal field [µT, rad]? Returns an event to tell; `_trusted` then says
        whether it may be used."""
        key = topics.MAGNETOMETER.key
        if self.is_normal(strength, dip) and abs(innovation) <= gate:
            self._steady_for = 0.0
            if not self._trusted:
                self._good_for += dt
                self._trusted = self._good_for >= HOLD_OFF
                self._told = self._told and not self._trusted
            return None
        self._good_for, self._trusted = 0.0, False
        if self._is_new_normal(strength, dip, bearing, dt):
            self.learn(strength, dip)
            return events.LEARNT(key)
        if self._told or (self.strength is None and LEAST_EARTH <= strength <= MOST_EARTH):
            return None
        self._told = True
        return events.DISTURBED(key)

    def is_normal(self, strength: float, dip: float) -> bool:
        """Are strength [µT] and dip [rad] those of the normal field?"""
        if self.strength is None or self.dip is None:
            return False
        near = abs(strength - self.strength) <= FIELD_TOLERANCE
        return near and abs(degrees(dip - self.dip)) <= DIP_TOLERANCE

    def _is_new_normal(self, strength: float, dip: float, bearing: float, dt: float) -> bool:
        first = self._first
        same = (
            abs(strength - first[0]) <= FIELD_TOLERANCE
            and abs(degrees(dip - first[1])) <= DIP_TOLERANCE
            and abs(remainder(bearing - first[2], 2.0 * pi)) <= GATE
        )
        if not same or not LEAST_EARTH <= strength <= MOST_EARTH:
            self._first, self._steady_for = (strength, dip, bearing), 0.0
            return False
        self._steady_for += dt
        return self._steady_for >= (HOLD_OFF if self.strength is None else RELEARN)


def _row(field: Vec3) -> Row:
    """What the bearing of this field, world axes, measures."""
    n, e, d = field
    square = n * n + e * e
    return (
        (NORTH, 1.0), (DEVIATION, 1.0), (YAW, 1.0),
        (TILT, -d * n / square), (TILT + 1, -d * e / square),
    )  # fmt: skip
