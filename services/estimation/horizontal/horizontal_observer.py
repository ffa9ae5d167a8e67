"""From DVL, USBL and thrust to position, velocity over the ground and current.

Rates as in Fernandes et al. 2015, appendix B: acoustic fixes once a second or less, DVL once a
second; between them the accelerometer is integrated. Without DVL and USBL there is no estimate.
"""

from collections.abc import Callable, Sequence
from math import cos, hypot, sin
from typing import NamedTuple

from messages import events, topics
from messages.events import Event
from messages.message import Estimate
from messages.sensors import DvlSample, UsblSample
from messages.units import Quaternion, Vec3
from messages.vehicle import Actuation
from services.estimation.aiding import Aiding
from services.estimation.attitude.heading import horizontal, wrapped
from services.estimation.horizontal import horizontal_filter as ekf
from services.estimation.horizontal.compass_deviation import Coefficients, CompassDeviation
from services.estimation.horizontal.horizontal_filter import (
    HorizontalEstimate,
    Innovation,
    Interval,
    Pair,
)
from services.estimation.horizontal.hull_model import HullModel
from services.estimation.horizontal.lock import BottomLock
from services.estimation.horizontal.measurement_buffer import (
    BufferNode,
    Correction,
    MeasurementBuffer,
)
from services.marine.attitude import LEVEL, heading_of, to_body

INTERVAL_NS = 95_000_000  # [ns] between two filter steps; in between only the mean advances
LONGEST_STEP = 0.5  # [s] no prediction over a longer gap
LEAST_DVL_STD, LEAST_USBL_STD = 0.001, 0.01  # [m/s], [m] no sensor is better
MOST_CHANGE = 0.5  # [m/s²] acceleration of the vehicle before the filter started
PATIENCE = 0.5  # [s] an older thrust report is not used
GATE = 6.0  # [σ] an innovation beyond is an outlier
# So many outliers in a row, for so long, and the filter restarts. A DVL that takes a school of fish
# for the bottom says the same wrong velocity ten times a second, for seconds.
MOST_OUTLIERS, OUTLIERS_LAST = 5, 4.0  # [-], [s]
LOST_AFTER = 60.0  # [s] without either: prediction is useless
OLDEST = 4.0  # [s] largest age of a sample
MOST_CURRENT_STD = 0.15  # [m/s] a current with a larger std is not published
DVL, USBL, THRUST = topics.DVL.key, topics.USBL.key, topics.ACTUATION.key
VALID_FOR = {DVL: 3.0, USBL: 15.0}  # [s] after the last accepted sample
MEASURES = {DVL: "velocity", USBL: "position"}

MeasurementModel = Callable[[HorizontalEstimate, Interval], Innovation]


class VehicleMotion(NamedTuple):
    """Estimates of the other filters at one instant."""

    attitude: Quaternion  # q_NB, yaw is the control heading
    offset: float | None  # [rad] north heading minus control heading; None: unknown
    heading_std: float  # [rad] of the heading from north
    specific_force: Vec3 | None  # [m/s²] FRD; None: IMU silent
    yaw_rate: float = 0.0  # [rad/s]
    depth_rate: float = 0.0  # [m/s]
    depth_rate_std: float = 0.0  # [m/s]


class Compared(NamedTuple):
    """A measurement beside what the filter expected of it."""

    estimate: HorizontalEstimate  # before it
    innovation: Innovation
    surprise: float  # [-] normalised innovation squared


class HorizontalEstimates(NamedTuple):
    """None: unknown."""

    north: Estimate | None  # [m]
    east: Estimate | None  # [m]
    surge: Estimate | None  # [m/s] over the ground
    sway: Estimate | None  # [m/s]
    current_north: Estimate | None  # [m/s] of the water over the ground
    current_east: Estimate | None  # [m/s]


NOTHING = HorizontalEstimates(None, None, None, None, None, None)


class HorizontalObserver:
    """Position, velocity over the ground and current in NED.

    A sample is used at its own time of validity: the filter keeps its recent past and runs again
    from there. An innovation beyond the gate is an outlier; after `MOST_OUTLIERS` of them in a row,
    over `OUTLIERS_LAST`, the filter restarts at the newest sample.

    With a DVL alone, position is relative to its first sample, and its std grows.
    """

    def __init__(self, hull: HullModel | None = None) -> None:
        """`hull` None: the current stays unknown."""
        # By what is measured, an `Aiding` for each component. Of the thrust: accelerometer beside
        # the acceleration that thrust and drag explain.
        self.aiding = {
            DVL: (Aiding("dvl_surge", "m/s"), Aiding("dvl_sway", "m/s")),
            USBL: (Aiding("usbl_north", "m"), Aiding("usbl_east", "m")),
            THRUST: (Aiding("thrust_surge", "m/s²"), Aiding("thrust_sway", "m/s²")),
        }
        self._hull = hull
        self._buffer = MeasurementBuffer(self._step, OLDEST)
        self._open = OpenInterval()
        self._at_ns: int | None = None
        self._motion = VehicleMotion(LEVEL, None, 0.0, None)
        self._started = False
        self._fixed = False  # a USBL fix has set the origin of north and east
        self._balanced = False  # thrust and drag have been used as a measurement
        self._balance: Compared | None = None  # the newest of those
        self._begun_ns = 0
        self._heard: dict[str, int] = {}  # [ns] stamp of the last accepted sample
        self._outliers = {key: list[int]() for key in VALID_FOR}  # [ns] stamps, those in a row
        self._lock = BottomLock()
        self._values = self._variances = [0.0] * ekf.SIZE  # of the newest node
        self._error = 0.0  # [rad] of the compass there
        self._now: tuple[float, float, float, float] | None = None  # cache of `_mean`
        self._deviation = CompassDeviation()
        self._thrust: tuple[float, ...] | None = None  # [N] newest report, per thruster
        self._thrust_ns = 0

    def predict(self, motion: VehicleMotion, at_ns: int) -> Event | None:
        """Advance to `at_ns`. Returns an event to tell."""
        before = at_ns if self._at_ns is None else self._at_ns
        if at_ns < before:
            return None
        self._at_ns, self._motion = at_ns, motion
        dt = (at_ns - before) * 1e-9
        if not self._started:
            if self._deviation.used:
                self._deviation.forget(dt)
            return None
        if at_ns == before:
            return None
        if dt > LONGEST_STEP or self._is_lost(at_ns):
            return self._stop(events.LOST_POSITION())
        measured = None
        if motion.specific_force is not None:
            measured = to_north(motion.attitude, motion.offset or 0.0, motion.specific_force)
        force, self._now = None, None
        recent = abs(at_ns - self._thrust_ns) * 1e-9 <= PATIENCE
        if self._hull is not None and self._thrust is not None and recent:
            force = self._hull.force(self._thrust)
        self._open.add(dt, measured, motion.yaw_rate, force)
        self._lock.sink(motion.depth_rate * dt)
        return self._close(at_ns) if at_ns - self._buffer.last.stamp_ns >= INTERVAL_NS else None

    def actuation(self, sample: Actuation) -> Event | None:
        """Thrust as reported. Returns an event to tell."""
        if self._hull is None:
            return None
        if len(sample.thrust) != self._hull.thrusters:
            return events.WRONG_LENGTH_ACTUATION()
        self._thrust, self._thrust_ns = sample.thrust, sample.stamp_ns
        return None

    def dvl(self, sample: DvlSample) -> Event | None:
        """Use a validated sample. Returns an event to tell."""
        measured, std = sample.velocity, max(LEAST_DVL_STD, sample.std)
        if measured is None:
            return None
        first = std if self._started else hypot(std, MOST_CHANGE * self._age(sample.stamp_ns))
        self._lock.see(sample.altitude, sample.stamp_ns, hypot(*measured[:2]))
        return self._use(
            DVL,
            sample.stamp_ns,
            measured[:2],
            lambda estimate, interval: ekf.velocity(estimate, interval, measured, std),
            lambda estimate, interval: ekf.changed_to(estimate, interval, measured, first),
        )

    def usbl(self, sample: UsblSample) -> Event | None:
        """Use a validated fix. Returns an event to tell."""
        measured, std = (sample.north, sample.east), max(LEAST_USBL_STD, sample.std)
        first = std if self._started else hypot(std, ekf.UNMEASURED * self._age(sample.stamp_ns))
        return self._use(
            USBL,
            sample.stamp_ns,
            measured,
            lambda estimate, _: ekf.fix(estimate, measured, std),
            lambda estimate, _: ekf.moved_to(estimate, measured, first),
        )

    # Estimates.

    @property
    def origin(self) -> int | None:
        """Names the origin of north and east: 0 that of the fixes, else the moment [ms] when the
        filter began, where the drone then was; None: no position."""
        if not self._started:
            return None
        return 0 if self._fixed else self._begun_ns // 1_000_000

    def estimates(self, now: int) -> HorizontalEstimates:
        """At `now` [ns]. Valid while DVL or USBL are: dead reckoning counts, with its growing
        std. Without thrust reports, or with an std above `MOST_CURRENT_STD`, the current is not
        known."""
        if not self._started:
            return NOTHING
        x, y, north, east = self._mean()
        motion, turn, valid = self._motion, self._motion.offset or 0.0, self._hears(USBL, now)
        valid = valid or self._hears(DVL, now)
        stds = [variance**0.5 for variance in self._variances[:6]]
        north, east = ekf.turned((north, east), -turn)
        surge, sway, _ = to_body(motion.attitude, (north, east, motion.depth_rate))
        std, current_north, current_east = max(stds[2], stds[3]), None, None
        if self._balanced and max(stds[4:]) <= MOST_CURRENT_STD:
            current = ekf.turned((self._values[4], self._values[5]), self._error)
            current_north = Estimate(current[0], stds[4], valid)
            current_east = Estimate(current[1], stds[5], valid)
        return HorizontalEstimates(
            Estimate(x, stds[0], valid),
            Estimate(y, stds[1], valid),
            Estimate(surge, std, valid),
            Estimate(sway, std, valid),
            current_north,
            current_east,
        )

    def heading(self, compass: Estimate) -> Estimate:
        """The compass heading [rad], corrected for its deviation as far as it is known."""
        if not self._deviation.used:
            return compass
        value = compass.value + self._deviation.correction.at(compass.value)
        std = self._deviation.corrected_std(compass.std)
        return Estimate(wrapped(value), std, compass.valid)

    # Time update.

    def _step(self, estimate: HorizontalEstimate, interval: Interval) -> HorizontalEstimate:
        """One interval, with thrust and drag as a measurement."""
        estimate = ekf.predicted(estimate, interval)
        if self._hull is None or interval.acceleration is None or interval.force is None:
            return estimate
        innovation = ekf.balance(estimate, interval, self._hull)
        surprise, after = ekf.weighed(estimate, innovation)
        self._balance = Compared(estimate, innovation, surprise)
        return estimate if surprise > GATE**2 else after

    def _close(self, at_ns: int) -> Event | None:
        """Close the open interval."""
        interval = self._interval()
        self._open, self._balance = OpenInterval(), None
        self._buffer.extend(at_ns, interval)
        doubted = None
        if (seen := self._balance) is not None:
            self._balanced = True
            if seen.surprise > GATE**2:
                doubted = events.OUTLIER_ACTUATION()
            felt = ekf.felt(seen.estimate, interval)
            self._note(THRUST, at_ns, felt, seen, doubted)
        return self._read_out() or self._learn_deviation(at_ns, interval) or doubted

    def _note(
        self,
        key: str,
        stamp_ns: int,
        values: Sequence[float],
        seen: Compared,
        rejected: Event | None,
    ) -> None:
        """Keep what was made of a measurement, of both components."""
        off: list[float] = seen.innovation.off.tolist()
        variances = ekf.covariance(seen.estimate, seen.innovation).diagonal().tolist()
        ratio = seen.surprise / GATE**2
        each = zip(self.aiding[key], values, off, variances, strict=True)
        for aiding, value, innovation, variance in each:
            aiding.compare(stamp_ns, value, innovation, variance, ratio, rejected=rejected)

    def _learn_deviation(self, now: int, interval: Interval) -> Event | None:
        """Only while both DVL and USBL are valid; one alone does not determine north."""
        if self._motion.offset is None or not (self._hears(USBL, now) and self._hears(DVL, now)):
            self._deviation.hold()
            return None
        a, b, c = (self._values[each] for each in ekf.DEVIATION)
        std = ekf.heading_std(self._buffer.last.estimate, interval)
        heading = heading_of(interval.attitude)
        return self._deviation.follow(Coefficients(a, b, c), std, heading, interval.seconds)

    def _read_out(self) -> Event | None:
        """Copy the newest estimate to plain floats, for reading at the IMU's rate."""
        estimate, interval = self._buffer.last.estimate, self._buffer.last.interval
        if not ekf.is_sound(estimate):
            return self._stop(events.NOT_FINITE("position"))
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
        """Now: position [m], NED, and velocity [m/s], by the compass' north and east."""
        if self._now is not None:
            return self._now
        x, y, u, v, _, _, lean_north, lean_east, *_ = self._values
        t, a, b = self._open.seconds, 0.0, 0.0
        if (gained := self._open.gained) is not None:
            a, b = gained[0] - lean_north * t, gained[1] - lean_east * t
        north, east = ekf.turned(((u + 0.5 * a) * t, (v + 0.5 * b) * t), self._error)
        self._now = x + north, y + east, u + a, v + b
        return self._now

    # Measurement update.

    def _use(
        self,
        key: str,
        stamp_ns: int,
        values: Sequence[float],
        model: MeasurementModel,
        restart: Correction,
    ) -> Event | None:
        """Correct by a sample that is not an outlier; restart from one that has no prediction to
        compare with, or after too many outliers."""
        age = self._age(stamp_ns)
        if self._at_ns is None:
            return self._refuse(key, stamp_ns, events.UNREADY(key))
        if age < -LONGEST_STEP:
            return self._refuse(key, stamp_ns, events.AHEAD(key))
        if age > OLDEST:
            return self._refuse(key, stamp_ns, events.TOO_OLD(key))
        if not self._started:
            return self._accept(key, stamp_ns, self._begin(self._at_ns), restart)
        node = self._node(stamp_ns, self._at_ns)
        if node is None:
            return self._refuse(key, stamp_ns, events.TOO_OLD(key))
        if key == USBL and not self._fixed:
            return self._accept(key, stamp_ns, node, restart)
        innovation = model(node.estimate, node.interval)
        surprise = ekf.surprise(node.estimate, innovation)
        seen = Compared(node.estimate, innovation, surprise)
        swims = key == DVL and self._lock.swims(surprise)
        if surprise <= GATE**2 and not swims:
            self._note(key, stamp_ns, values, seen, None)
            return self._accept(
                key, stamp_ns, node, lambda e, interval: ekf.corrected(e, model(e, interval))
            )
        outliers = self._outliers[key]
        outliers.append(stamp_ns)
        lasting = len(outliers) >= MOST_OUTLIERS and stamp_ns - outliers[0] >= OUTLIERS_LAST * 1e9
        event = events.RESTARTED(MEASURES[key]) if lasting else events.OUTLIER(key)
        self._note(key, stamp_ns, values, seen, event)
        if not lasting:
            return event
        return self._accept(key, stamp_ns, node, restart) or event

    def _refuse(self, key: str, stamp_ns: int, why: Event) -> Event:
        for aiding in self.aiding[key]:
            aiding.refuse(why, stamp_ns)
        return why

    def _accept(
        self, key: str, stamp_ns: int, node: BufferNode, correction: Correction
    ) -> Event | None:
        self._outliers[key].clear()
        self._heard[key] = max(stamp_ns, self._heard.get(key, stamp_ns))
        if key == DVL:
            self._lock.believe()
        self._fixed = self._fixed or key == USBL
        self._buffer.correct(node, correction)
        return self._read_out()

    def _node(self, stamp_ns: int, now: int) -> BufferNode | None:
        """The node of a sample; None: from before the filter started."""
        if stamp_ns > self._buffer.last.stamp_ns and self._open.seconds > 0.0:
            self._close(now)
        return self._buffer.node_at(stamp_ns)

    def _begin(self, now: int) -> BufferNode:
        self._started, self._fixed, self._balanced = True, False, False
        self._open = OpenInterval()
        self._begun_ns = now
        self._buffer.begin(now, self._interval(), ekf.initial(self._motion.heading_std))
        return self._buffer.last

    def _age(self, stamp_ns: int) -> float:
        """[s] Age of a sample; 0 before the first IMU sample."""
        return 0.0 if self._at_ns is None else (self._at_ns - stamp_ns) * 1e-9

    def _is_lost(self, now: int) -> bool:
        newest = max(self._begun_ns, *self._heard.values())
        return (now - newest) * 1e-9 > LOST_AFTER

    def _hears(self, key: str, now: int) -> bool:
        heard = self._heard.get(key)
        return heard is not None and (now - heard) * 1e-9 <= VALID_FOR[key]

    def _stop(self, why: Event) -> Event:
        """Discard the estimate."""
        self._started = self._fixed = False
        self._heard.clear()
        return why


class OpenInterval:
    """An interval not yet closed. One sample without acceleration or force makes that quantity
    unknown for the whole interval."""

    __slots__ = ("_force", "_gained", "_turned", "seconds")

    def __init__(self) -> None:
        self.seconds = 0.0
        self._gained: Pair | None = (0.0, 0.0)  # [m/s] north, east
        self._force: Pair | None = (0.0, 0.0)  # [N s] surge, sway
        self._turned = 0.0  # [rad]

    def add(
        self, dt: float, acceleration: Pair | None, yaw_rate: float, force: Pair | None
    ) -> None:
        """Add `dt` [s] with this acceleration [m/s²], yaw rate [rad/s] and thrust [N]."""
        self.seconds += dt
        self._turned += yaw_rate * dt
        self._gained = _sum(self._gained, acceleration, dt)
        self._force = _sum(self._force, force, dt)

    @property
    def gained(self) -> Pair | None:
        """[m/s] Change of velocity, north and east, lean included; None: IMU silent."""
        return self._gained

    @property
    def acceleration(self) -> Pair | None:
        """[m/s²] Mean, north and east, lean included; None: IMU silent."""
        return _mean(self._gained, self.seconds)

    @property
    def force(self) -> Pair | None:
        """[N] Mean, surge and sway; None: unknown."""
        return _mean(self._force, self.seconds)

    @property
    def yaw_rate(self) -> float:
        """[rad/s] Mean."""
        return self._turned / self.seconds if self.seconds > 0.0 else 0.0


def to_north(attitude: Quaternion, offset: float, v: Vec3) -> Pair:
    """North and east components of a body vector, for an attitude whose yaw is the control heading;
    `offset` [rad]: north heading minus control heading."""
    n, e = horizontal(attitude, v)
    c, s = cos(offset), sin(offset)
    return n * c - e * s, n * s + e * c


def from_north(attitude: Quaternion, offset: float) -> Quaternion:
    """The same attitude with its yaw counted from north."""
    w, x, y, z = attitude
    c, s = cos(offset / 2.0), sin(offset / 2.0)
    return c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w


def _sum(total: Pair | None, rate: Pair | None, dt: float) -> Pair | None:
    if total is None or rate is None:
        return None
    return total[0] + rate[0] * dt, total[1] + rate[1] * dt


def _mean(total: Pair | None, seconds: float) -> Pair | None:
    if total is None or seconds <= 0.0:
        return None
    return total[0] / seconds, total[1] / seconds
