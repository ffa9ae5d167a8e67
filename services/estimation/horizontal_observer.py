"""From DVL and USBL samples to position and velocity over the ground, where a vehicle has them.

Rates as in Fernandes et al. 2015: acoustic fixes once a second or less, DVL once a second; between
them the accelerometer carries on. Without either nothing is known and nothing is said.

The current is not estimated. It is the difference between velocity over the ground and velocity
through the water, and nothing on board measures the latter.
"""

from collections import deque
from math import cos, hypot, sin
from typing import NamedTuple

from messages.message import Estimate
from messages.sensors import DvlSample, UsblSample
from services.estimation.attitude_filter import Quaternion, Vec3
from services.estimation.heading import horizontal
from services.estimation.horizontal_filter import HorizontalFilter, HorizontalSettings, Pair, Row3

KEPT_EVERY_NS = 40_000_000  # [ns] between two entries of the history
LONGEST_STEP = 0.5  # [s] no prediction over a longer gap
LEAST_DVL_STD, LEAST_USBL_STD = 0.001, 0.01  # [m/s], [m] nobody measures better
HEADING_TIME = 10.0  # [s] for which an error of heading stays the same
UNKNOWN = 1.0  # [m/s] spread of the velocity before anybody has measured it


class Past(NamedTuple):
    """Where and how the vehicle was, to go back to a sample's own time."""

    stamp_ns: int
    attitude: Quaternion  # q_NB, yaw is the control heading
    offset: float  # [rad] north, from where the control heading believes it is
    moved: Pair  # [m] so far, by prediction
    gained: Pair  # [m/s] so far, by prediction


class HorizontalObserver:
    """Position and velocity in NED.

    A sample of age D is compared with where the vehicle was, or how fast, D ago: the prediction
    made since then is taken off. An innovation beyond the gate is an outlier; `outliers` of them in
    a row mean that the vehicle, and not the sample, is somewhere else, and the filter starts there.

    With a DVL alone, position is counted from where it first spoke, and its spread grows.
    """

    def __init__(self, settings: HorizontalSettings) -> None:
        self._settings = settings
        self._filter = HorizontalFilter(settings)
        self._past: deque[Past] = deque(maxlen=round(settings.oldest * 1e9 / KEPT_EVERY_NS) + 2)
        self._now = Past(0, (1.0, 0.0, 0.0, 0.0), 0.0, (0.0, 0.0), (0.0, 0.0))
        self._started = False
        self._fixed = False  # a USBL fix has said where north and east are zero
        self._dvl_ns: int | None = None  # [ns] last accepted sample
        self._usbl_ns: int | None = None
        self._begun_ns: int | None = None
        self._outliers = {"dvl": 0, "usbl": 0}  # in a row

    def predict(
        self,
        attitude: Quaternion,
        offset: float | None,
        heading_std: float,
        force: Vec3 | None,
        at_ns: int,
    ) -> str | None:
        """Move on to `at_ns` with the attitude q_NB, north's offset and its spread [rad] and the
        specific force [m/s²], FRD, there. Returns what went wrong, for the counters."""
        dt = (at_ns - self._now.stamp_ns) * 1e-9
        offset = offset or 0.0
        if not self._started:
            self._now = self._now._replace(stamp_ns=at_ns, attitude=attitude, offset=offset)
            return None
        if dt <= 0.0:
            return None
        if dt > LONGEST_STEP or self._is_lost(at_ns):
            return self._stop("lost:position")
        measured = None if force is None else to_north(attitude, offset, force)
        (u, v), (x, y), (g, h) = self._filter.velocity, self._now.moved, self._now.gained
        a, b = self._filter.predict(measured, dt)
        # A wrong heading leads astray; it leaves surge and sway as the DVL saw them.
        self._filter.p00 += (heading_std * hypot(u, v)) ** 2 * HEADING_TIME * dt
        moved = (x + (u + 0.5 * a * dt) * dt, y + (v + 0.5 * b * dt) * dt)
        self._now = Past(at_ns, attitude, offset, moved, (g + a * dt, h + b * dt))
        if not self._past or at_ns - self._past[-1].stamp_ns >= KEPT_EVERY_NS:
            self._past.append(self._now)
        return None if self._filter.is_sound() else self._stop("not_finite:position")

    def dvl(self, sample: DvlSample) -> str | None:
        """Use a plausible sample. Returns what is to be counted."""
        past = self._at(sample.stamp_ns)
        if past is None:
            return "late:sensor/dvl"
        measured = to_north(past.attitude, past.offset, sample.velocity)
        std = max(LEAST_DVL_STD, sample.std)
        if not self._started:
            self._begin(UNKNOWN)
        since = _minus(self._now.gained, past.gained)
        predicted = _minus(self._filter.velocity, since)
        row = (0.0, 1.0, (self._now.stamp_ns - past.stamp_ns) * 1e-9)
        event = self._update("dvl", row, _minus(measured, predicted), std)
        if event == "restart":
            self._filter.change_to(_plus(measured, since), std)
            event = "restarted:velocity"
        if event is None or event.startswith("restarted"):
            self._dvl_ns = sample.stamp_ns
        return event

    def usbl(self, sample: UsblSample) -> str | None:
        """Use a plausible fix. Returns what is to be counted."""
        past = self._at(sample.stamp_ns)
        if past is None:
            return "late:sensor/usbl"
        measured, std = (sample.north, sample.east), max(LEAST_USBL_STD, sample.std)
        if not self._started:
            self._begin(UNKNOWN)
        since = _minus(self._now.moved, past.moved)
        age = (self._now.stamp_ns - past.stamp_ns) * 1e-9
        event = "restart"
        if self._fixed:
            predicted = _minus(self._filter.position, since)
            row = (1.0, -age, -0.5 * age * age)
            event = self._update("usbl", row, _minus(measured, predicted), std)
        if event == "restart":
            event = "restarted:position" if self._fixed else None
            self._filter.move_to(_plus(measured, since), std)
            self._fixed = True
        if event is None or event.startswith("restarted"):
            self._usbl_ns = sample.stamp_ns
        return event

    def position(self, now: int) -> tuple[Estimate, Estimate] | None:
        """North and east [m]; None: unknown. Valid as long as velocity is: dead reckoning is a
        position too, with the spread it deserves."""
        if not self._started:
            return None
        (x, y), std, valid = self._filter.position, self._filter.position_std, self._valid(now)
        return Estimate(x, std, valid), Estimate(y, std, valid)

    def velocity(self, down_rate: float, now: int) -> tuple[Estimate, Estimate] | None:
        """Surge and sway [m/s] over the ground, with the depth rate [m/s]; None: unknown."""
        if not self._started:
            return None
        (w, x, y, z), turn = self._now.attitude, self._now.offset
        u, v = self._filter.velocity
        north, east = u * cos(turn) + v * sin(turn), v * cos(turn) - u * sin(turn)
        surge = (
            (1 - 2 * (y * y + z * z)) * north + 2 * (x * y + w * z) * east
            + 2 * (x * z - w * y) * down_rate
        )  # fmt: skip
        sway = (
            2 * (x * y - w * z) * north + (1 - 2 * (x * x + z * z)) * east
            + 2 * (y * z + w * x) * down_rate
        )  # fmt: skip
        std, valid = self._filter.velocity_std, self._valid(now)
        return Estimate(surge, std, valid), Estimate(sway, std, valid)

    def _update(self, name: str, row: Row3, off: Pair, std: float) -> str | None:
        """None: used; "restart": too many outliers; else what is to be counted."""
        variance = self._filter.variance(row) + std * std
        if hypot(*off) > self._settings.gate * variance**0.5:
            self._outliers[name] += 1
            if self._outliers[name] < self._settings.outliers:
                return f"outlier:sensor/{name}"
            self._outliers[name] = 0
            return "restart"
        self._outliers[name] = 0
        self._filter.update(row, off, variance)
        return None if self._filter.is_sound() else self._stop("not_finite:position")

    def _at(self, stamp_ns: int) -> Past | None:
        """How it was then, to the nearest entry; None: too long ago."""
        age = (self._now.stamp_ns - stamp_ns) * 1e-9
        if age > self._settings.oldest or age < -LONGEST_STEP:
            return None
        nearest = self._now
        for past in reversed(self._past):
            if abs(past.stamp_ns - stamp_ns) > abs(nearest.stamp_ns - stamp_ns):
                break
            nearest = past
        return nearest

    def _begin(self, velocity_std: float) -> None:
        self._filter.start(LEAST_USBL_STD, velocity_std)
        self._started, self._fixed = True, False
        self._dvl_ns = self._usbl_ns = None
        self._begun_ns = self._now.stamp_ns

    def _is_lost(self, now: int) -> bool:
        heard = [ns for ns in (self._dvl_ns, self._usbl_ns, self._begun_ns) if ns is not None]
        return (now - max(heard)) * 1e-9 > self._settings.lost_after

    def _valid(self, now: int) -> bool:
        limits = self._settings
        return any(
            heard is not None and (now - heard) * 1e-9 <= seconds
            for heard, seconds in (
                (self._dvl_ns, limits.dvl_valid_for),
                (self._usbl_ns, limits.usbl_valid_for),
            )
        )

    def _stop(self, why: str) -> str:
        """Nothing is known any more."""
        self._started = self._fixed = False
        self._past.clear()
        self._filter = HorizontalFilter(self._settings)
        return why


def to_north(attitude: Quaternion, offset: float, v: Vec3) -> Pair:
    """North and east components of a body vector, for an attitude whose yaw is `offset` [rad]
    short of the heading from north."""
    n, e = horizontal(attitude, v)
    c, s = cos(offset), sin(offset)
    return n * c - e * s, n * s + e * c


def _minus(a: Pair, b: Pair) -> Pair:
    return a[0] - b[0], a[1] - b[1]


def _plus(a: Pair, b: Pair) -> Pair:
    return a[0] + b[0], a[1] + b[1]
