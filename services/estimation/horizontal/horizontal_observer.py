"""From DVL, USBL and thrust to position, velocity over the ground and current, where a vehicle has
them.

Rates as in Fernandes et al. 2015, appendix B: acoustic fixes once a second or less, DVL once a
second; between them the accelerometer carries on. Without either nothing is known and nothing is
said.
"""

from collections.abc import Callable
from functools import partial
from math import cos, hypot, sin
from typing import NamedTuple

from messages.message import Estimate
from messages.sensors import DvlSample, UsblSample
from messages.units import Quaternion, Vec3
from messages.vehicle import Actuation
from services.estimation.attitude.heading import horizontal, wrapped
from services.estimation.horizontal import horizontal_filter as ekf
from services.estimation.horizontal.compass_deviation import Coefficients, CompassDeviation
from services.estimation.horizontal.horizontal_filter import (
    HorizontalEstimate,
    Innovation,
    Interval,
    Pair,
)
from services.estimation.horizontal.horizontal_settings import HorizontalSettings
from services.estimation.horizontal.hull_model import HullModel
from services.estimation.horizontal.interval_sums import OpenInterval
from services.estimation.horizontal.measurement_buffer import (
    BufferNode,
    Correction,
    MeasurementBuffer,
)
from services.marine.attitude import LEVEL, heading_of, to_body

LEG_NS = 95_000_000  # [ns] between two steps of the covariance; the mean goes on in between
LONGEST_STEP = 0.5  # [s] no prediction over a longer gap
LEAST_DVL_STD, LEAST_USBL_STD = 0.001, 0.01  # [m/s], [m] nobody measures better
MOST_CHANGE = 0.5  # [m/s²] by which the velocity may have changed before the filter ran
MEASURES = {"dvl": "velocity", "usbl": "position"}

See = Callable[[HorizontalEstimate, Interval], Innovation]


class VehicleMotion(NamedTuple):
    """What the other filters know at one moment."""

    attitude: Quaternion  # q_NB, yaw is the control heading
    offset: float | None  # [rad] north, from where the control heading believes it is
    heading_std: float  # [rad] of the heading from north
    specific_force: Vec3 | None  # [m/s²] FRD; None: IMU silent
    yaw_rate: float = 0.0  # [rad/s]
    depth_rate: float = 0.0  # [m/s]
    depth_rate_std: float = 0.0  # [m/s]


class HorizontalObserver:
    """Position, velocity over the ground and current in NED.

    A sample is used at its own time of validity: the recent past is kept and filtered anew from
    there. An innovation beyond the gate is an outlier; `outliers` of them in a row mean that the
    vehicle, and not the sample, is somewhere else, and the filter starts there.

    With a DVL alone, position is counted from where it first spoke, and its spread grows.
    """

    def __init__(self, settings: HorizontalSettings, hull: HullModel | None = None) -> None:
        """Without a hull, the current stays unknown."""
        self.surprise: dict[str, float] = {}  # newest normalised innovation squared, by sensor
        self._settings = settings
        self._hull = hull
        self._buffer = MeasurementBuffer(self._step, settings.oldest)
        self._open = OpenInterval()
        self._at_ns: int | None = None
        self._motion = VehicleMotion(LEVEL, None, 0.0, None)
        self._started = False
        self._fixed = False  # a USBL fix has said where north and east are zero
        self._balanced = False  # thrust and drag have told of the water
        self._doubted = False  # the last they told was an outlier
        self._begun_ns = 0
        self._heard: dict[str, int] = {}  # [ns] stamp of the last accepted sample
        self._valid_for = {"dvl": settings.dvl_valid_for, "usbl": settings.usbl_valid_for}  # [s]
        self._outliers = {"dvl": 0, "usbl": 0}  # in a row
        self._values = self._variances = [0.0] * ekf.SIZE  # of the newest stone
        self._error = 0.0  # [rad] of the compass there
        self._now: tuple[float, float, float, float] | None = None  # what `_mean` has found
        self._deviation = CompassDeviation()
        self._force: Pair | None = None  # [N] surge and sway of the newest actuation
        self._force_ns = 0

    def predict(self, motion: VehicleMotion, at_ns: int) -> str | None:
        """Move on to `at_ns`. Returns what went wrong, for the counters."""
        before = at_ns if self._at_ns is None else self._at_ns
        if at_ns < before:
            return None
        self._at_ns, self._motion = at_ns, motion
        dt = (at_ns - before) * 1e-9
        if not self._started:
            self._deviation.forget(dt)
            return None
        if at_ns == before:
            return None
        if dt > LONGEST_STEP or self._is_lost(at_ns):
            return self._stop("lost:position")
        measured = None
        if motion.specific_force is not None:
            measured = to_north(motion.attitude, motion.offset or 0.0, motion.specific_force)
        self._now = None
        self._open.add(dt, measured, motion.yaw_rate, self._thrust(at_ns))
        return self._close(at_ns) if at_ns - self._buffer.last.stamp_ns >= LEG_NS else None

    def actuation(self, sample: Actuation) -> str | None:
        """What the thrusters really do. Returns what is to be counted."""
        if self._hull is None:
            return None
        if len(sample.thrust) != self._hull.thrusters:
            return "wrong_length:vehicle/actuation"
        self._force, self._force_ns = self._hull.force(sample.thrust), sample.stamp_ns
        return None

    def dvl(self, sample: DvlSample) -> str | None:
        """Use a plausible sample. Returns what is to be counted."""
        seen, std = sample.velocity, max(LEAST_DVL_STD, sample.std)
        see, anew = partial(_velocity, seen, std), partial(_change, seen, std)
        if not self._started:
            std = hypot(std, MOST_CHANGE * self._age(sample.stamp_ns))
            anew = partial(_change, seen, std)
        return self._use("dvl", sample.stamp_ns, see, anew)

    def usbl(self, sample: UsblSample) -> str | None:
        """Use a plausible fix. Returns what is to be counted."""
        place, std = (sample.north, sample.east), max(LEAST_USBL_STD, sample.std)
        see, anew = partial(_fix, place, std), partial(_move, place, std)
        if not self._started:
            std = hypot(std, ekf.UNMEASURED * self._age(sample.stamp_ns))
            anew = partial(_move, place, std)
        return self._use("usbl", sample.stamp_ns, see, anew)

    # What is known.

    def position(self, now: int) -> tuple[Estimate, Estimate] | None:
        """North and east [m]; None: unknown. Valid as long as velocity is: dead reckoning is a
        position too, with the spread it deserves."""
        if not self._started:
            return None
        (x, y, *_), valid = self._mean(), self._valid(now)
        return Estimate(x, self._std(0), valid), Estimate(y, self._std(1), valid)

    def velocity(self, now: int) -> tuple[Estimate, Estimate] | None:
        """Surge and sway [m/s] over the ground; None: unknown."""
        if not self._started:
            return None
        _, _, u, v = self._mean()
        motion, turn = self._motion, self._offset()
        c, s = cos(turn), sin(turn)
        north, east = u * c + v * s, v * c - u * s
        surge, sway, _ = to_body(motion.attitude, (north, east, motion.depth_rate))
        std, valid = max(self._std(2), self._std(3)), self._valid(now)
        return Estimate(surge, std, valid), Estimate(sway, std, valid)

    def current(self, now: int) -> tuple[Estimate, Estimate] | None:
        """[m/s] North and east, of the water over the ground; None: unknown, because the thrust is
        not heard or has not told enough."""
        if not self._started or not self._balanced:
            return None
        stds = self._std(4), self._std(5)
        if max(stds) > self._settings.current_limit:
            return None
        valid = self._valid(now)
        x, y = self._values[4:6]
        return Estimate(x, stds[0], valid), Estimate(y, stds[1], valid)

    def heading(self, compass: Estimate) -> Estimate:
        """The compass' heading [rad], with its deviation corrected as far as it is known."""
        value = compass.value + self._deviation.told.at(compass.value)
        std = self._deviation.corrected_std(compass.std)
        return Estimate(wrapped(value), std, compass.valid)

    # How time goes on.

    def _step(self, estimate: HorizontalEstimate, interval: Interval) -> HorizontalEstimate:
        """One leg, with what thrust and drag say of it."""
        estimate = ekf.predicted(estimate, interval, self._settings)
        if self._hull is None or interval.acceleration is None or interval.force is None:
            return estimate
        seen = ekf.balance(estimate, interval, self._hull, self._settings)
        surprise, better = ekf.weighed(estimate, seen)
        self._doubted = surprise > self._settings.gate**2
        return estimate if self._doubted else better

    def _close(self, at_ns: int) -> str | None:
        """The open leg ends now."""
        interval = self._interval()
        self._open, self._doubted = OpenInterval(), False
        self._buffer.extend(at_ns, interval)
        if interval.force is not None and interval.acceleration is not None:
            self._balanced = True
        doubted = "outlier:vehicle/actuation" if self._doubted else None
        return self._take() or self._learn_deviation(at_ns, interval) or doubted

    def _learn_deviation(self, now: int, interval: Interval) -> str | None:
        """From a newest leg that both aids tell of; one of them alone says nothing of north."""
        if self._motion.offset is None or not (
            self._hears("usbl", now) and self._hears("dvl", now)
        ):
            self._deviation.hold()
            return None
        a, b, c = (self._values[each] for each in ekf.DEVIATION)
        std = ekf.heading_spread(self._buffer.last.estimate, interval)
        heading = heading_of(interval.attitude)
        return self._deviation.follow(Coefficients(a, b, c), std, heading, interval.seconds)

    def _take(self) -> str | None:
        """Keep the newest belief as plain numbers, which is what is read at the IMU's rate."""
        estimate, interval = self._buffer.last.estimate, self._buffer.last.interval
        if not ekf.is_sound(estimate):
            return self._stop("not_finite:position")
        self._values, self._variances = estimate.x.tolist(), estimate.P.diagonal().tolist()
        self._error, self._now = ekf.heading_error(estimate, interval), None
        return None

    def _interval(self) -> Interval:
        motion, interval = self._motion, self._open
        return Interval(
            seconds=interval.seconds,
            acceleration=interval.acceleration,
            attitude=from_north(motion.attitude, motion.offset or 0.0),
            heading_std=motion.heading_std,
            yaw_rate=interval.yaw_rate,
            force=interval.force,
            depth_rate=motion.depth_rate,
            depth_rate_std=motion.depth_rate_std,
        )

    def _mean(self) -> tuple[float, float, float, float]:
        """Position [m] and velocity [m/s], north and east, now."""
        if self._now is not None:
            return self._now
        x, y, u, v, _, _, lean_north, lean_east, *_ = self._values
        t, a, b = self._open.seconds, 0.0, 0.0
        if (gained := self._open.gained) is not None:
            a, b = ekf.turned(gained, self._error)
            a, b = a - lean_north * t, b - lean_east * t
        self._now = x + (u + 0.5 * a) * t, y + (v + 0.5 * b) * t, u + a, v + b
        return self._now

    def _std(self, state: int) -> float:
        """Of a state at the newest stone."""
        return self._variances[state] ** 0.5

    def _offset(self) -> float:
        """[rad] North, from where the control heading believes it is, all that is known used."""
        return (self._motion.offset or 0.0) + self._error

    # How samples are used.

    def _use(self, name: str, stamp_ns: int, see: See, anew: Correction) -> str | None:
        """Believe a sample a little, if it is not an outlier; where there is nothing to compare it
        with, believe it alone."""
        if self._at_ns is None or self._age(stamp_ns) < -LONGEST_STEP:
            return f"ahead:sensor/{name}"
        if self._age(stamp_ns) > self._settings.oldest:
            return f"too_old:sensor/{name}"
        if not self._started:
            return self._accept(name, stamp_ns, self._begin(self._at_ns), anew)
        node = self._node(stamp_ns, self._at_ns)
        if node is None:
            return f"too_old:sensor/{name}"
        if name == "usbl" and not self._fixed:
            return self._accept(name, stamp_ns, node, anew)
        self.surprise[name] = ekf.surprise(node.estimate, see(node.estimate, node.interval))
        if self.surprise[name] <= self._settings.gate**2:
            return self._accept(name, stamp_ns, node, partial(_correct, see))
        self._outliers[name] += 1
        if self._outliers[name] < self._settings.outliers:
            return f"outlier:sensor/{name}"
        return self._accept(name, stamp_ns, node, anew) or f"restarted:{MEASURES[name]}"

    def _accept(
        self, name: str, stamp_ns: int, node: BufferNode, reading: Correction
    ) -> str | None:
        self._outliers[name] = 0
        self._heard[name] = max(stamp_ns, self._heard.get(name, stamp_ns))
        self._fixed = self._fixed or name == "usbl"
        self._buffer.read(node, reading)
        return self._take()

    def _node(self, stamp_ns: int, now: int) -> BufferNode | None:
        """Of a sample; None: from before the filter began."""
        if stamp_ns > self._buffer.last.stamp_ns and self._open.seconds > 0.0:
            self._close(now)
        return self._buffer.node_at(stamp_ns)

    def _begin(self, now: int) -> BufferNode:
        self._started, self._fixed, self._balanced = True, False, False
        self._open = OpenInterval()
        self._begun_ns = now
        self._buffer.begin(
            now, self._interval(), ekf.begun(self._settings, self._motion.heading_std)
        )
        return self._buffer.last

    def _age(self, stamp_ns: int) -> float:
        """[s] Of a sample; 0 before anything else was heard."""
        return 0.0 if self._at_ns is None else (self._at_ns - stamp_ns) * 1e-9

    def _thrust(self, now: int) -> Pair | None:
        """[N] Surge and sway; None: unknown."""
        recent = abs(now - self._force_ns) * 1e-9 <= self._settings.actuation_patience
        return self._force if recent else None

    def _is_lost(self, now: int) -> bool:
        newest = max(self._begun_ns, *self._heard.values())
        return (now - newest) * 1e-9 > self._settings.lost_after

    def _valid(self, now: int) -> bool:
        return self._hears("usbl", now) or self._hears("dvl", now)

    def _hears(self, name: str, now: int) -> bool:
        heard = self._heard.get(name)
        return heard is not None and (now - heard) * 1e-9 <= self._valid_for[name]

    def _stop(self, why: str) -> str:
        """Nothing is known any more."""
        self._started = self._fixed = False
        self._heard.clear()
        return why


def to_north(attitude: Quaternion, offset: float, v: Vec3) -> Pair:
    """North and east components of a body vector, for an attitude whose yaw is `offset` [rad]
    short of the heading from north."""
    n, e = horizontal(attitude, v)
    c, s = cos(offset), sin(offset)
    return n * c - e * s, n * s + e * c


def from_north(attitude: Quaternion, offset: float) -> Quaternion:
    """The same attitude with its yaw counted from north."""
    w, x, y, z = attitude
    c, s = cos(offset / 2.0), sin(offset / 2.0)
    return c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w


def _velocity(
    seen: Vec3, std: float, estimate: HorizontalEstimate, interval: Interval
) -> Innovation:
    return ekf.velocity(estimate, interval, seen, std)


def _fix(place: Pair, std: float, estimate: HorizontalEstimate, _: Interval) -> Innovation:
    return ekf.fix(estimate, place, std)


def _change(
    seen: Vec3, std: float, estimate: HorizontalEstimate, interval: Interval
) -> HorizontalEstimate:
    return ekf.changed_to(estimate, interval, seen, std)


def _move(place: Pair, std: float, estimate: HorizontalEstimate, _: Interval) -> HorizontalEstimate:
    return ekf.moved_to(estimate, place, std)


def _correct(see: See, estimate: HorizontalEstimate, interval: Interval) -> HorizontalEstimate:
    return ekf.corrected(estimate, see(estimate, interval))
