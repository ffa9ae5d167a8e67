"""From DVL, USBL and thrust to position, velocity over the ground and current.

Rates as in Fernandes et al. 2015, appendix B: acoustic fixes once a second or less, DVL once a
second; between them the accelerometer is integrated. Without DVL and USBL there is no estimate.
"""

from functools import partial
from math import cos, hypot, sin

from messages.message import Estimate
from messages.sensors import DvlSample, UsblSample
from messages.vehicle import Actuation
from services.estimation.attitude.heading import wrapped
from services.estimation.horizontal import horizontal_filter as ekf
from services.estimation.horizontal import sample_updates
from services.estimation.horizontal.compass_deviation import Coefficients, CompassDeviation
from services.estimation.horizontal.horizontal_filter import HorizontalEstimate, Interval, Pair
from services.estimation.horizontal.horizontal_settings import HorizontalSettings
from services.estimation.horizontal.hull_model import HullModel
from services.estimation.horizontal.interval_sums import OpenInterval
from services.estimation.horizontal.measurement_buffer import (
    BufferNode,
    Correction,
    MeasurementBuffer,
)
from services.estimation.horizontal.sample_updates import MeasurementModel
from services.estimation.horizontal.vehicle_motion import VehicleMotion, from_north, to_north
from services.marine.attitude import LEVEL, heading_of, to_body

INTERVAL_NS = 95_000_000  # [ns] between two filter steps; in between only the mean advances
LONGEST_STEP = 0.5  # [s] no prediction over a longer gap
LEAST_DVL_STD, LEAST_USBL_STD = 0.001, 0.01  # [m/s], [m] no sensor is better
MOST_CHANGE = 0.5  # [m/s²] acceleration of the vehicle before the filter started
MEASURES = {"dvl": "velocity", "usbl": "position"}


class HorizontalObserver:
    """Position, velocity over the ground and current in NED.

    A sample is used at its own time of validity: the filter keeps its recent past and runs again
    from there. An innovation beyond the gate is an outlier; after `outliers` of them in a row the
    filter restarts at the newest sample.

    With a DVL alone, position is relative to its first sample, and its std grows.
    """

    def __init__(self, settings: HorizontalSettings, hull: HullModel | None = None) -> None:
        """`hull` None: the current stays unknown."""
        self.surprise: dict[str, float] = {}  # newest normalised innovation squared, by sensor
        self._settings = settings
        self._hull = hull
        self._buffer = MeasurementBuffer(self._step, settings.oldest)
        self._open = OpenInterval()
        self._at_ns: int | None = None
        self._motion = VehicleMotion(LEVEL, None, 0.0, None)
        self._started = False
        self._fixed = False  # a USBL fix has set the origin of north and east
        self._balanced = False  # thrust and drag have been used as a measurement
        self._doubted = False  # the newest of those was an outlier
        self._begun_ns = 0
        self._heard: dict[str, int] = {}  # [ns] stamp of the last accepted sample
        self._valid_for = {"dvl": settings.dvl_valid_for, "usbl": settings.usbl_valid_for}  # [s]
        self._outliers = {"dvl": 0, "usbl": 0}  # in a row
        self._values = self._variances = [0.0] * ekf.SIZE  # of the newest node
        self._error = 0.0  # [rad] of the compass there
        self._now: tuple[float, float, float, float] | None = None  # cache of `_mean`
        self._deviation = CompassDeviation()
        self._force: Pair | None = None  # [N] surge and sway of the newest actuation
        self._force_ns = 0

    def predict(self, motion: VehicleMotion, at_ns: int) -> str | None:
        """Advance to `at_ns`. Returns an event to count."""
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
        return self._close(at_ns) if at_ns - self._buffer.last.stamp_ns >= INTERVAL_NS else None

    def actuation(self, sample: Actuation) -> str | None:
        """Thrust as reported. Returns an event to count."""
        if self._hull is None:
            return None
        if len(sample.thrust) != self._hull.thrusters:
            return "wrong_length:vehicle/actuation"
        self._force, self._force_ns = self._hull.force(sample.thrust), sample.stamp_ns
        return None

    def dvl(self, sample: DvlSample) -> str | None:
        """Use a validated sample. Returns an event to count."""
        measured, std = sample.velocity, max(LEAST_DVL_STD, sample.std)
        model, restart = (
            partial(sample_updates.velocity, measured, std),
            partial(sample_updates.set_velocity, measured, std),
        )
        if not self._started:
            std = hypot(std, MOST_CHANGE * self._age(sample.stamp_ns))
            restart = partial(sample_updates.set_velocity, measured, std)
        return self._use("dvl", sample.stamp_ns, model, restart)

    def usbl(self, sample: UsblSample) -> str | None:
        """Use a validated fix. Returns an event to count."""
        measured, std = (sample.north, sample.east), max(LEAST_USBL_STD, sample.std)
        model, restart = (
            partial(sample_updates.position, measured, std),
            partial(sample_updates.set_position, measured, std),
        )
        if not self._started:
            std = hypot(std, ekf.UNMEASURED * self._age(sample.stamp_ns))
            restart = partial(sample_updates.set_position, measured, std)
        return self._use("usbl", sample.stamp_ns, model, restart)

    # Estimates.

    def position(self, now: int) -> tuple[Estimate, Estimate] | None:
        """North and east [m]; None: unknown. Valid while velocity is: dead reckoning counts, with
        its growing std."""
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
        """[m/s] North and east, of the water over the ground; None: unknown, because there are no
        thrust reports or its std is above `current_limit`."""
        if not self._started or not self._balanced:
            return None
        stds = self._std(4), self._std(5)
        if max(stds) > self._settings.current_limit:
            return None
        valid = self._valid(now)
        x, y = self._values[4:6]
        return Estimate(x, stds[0], valid), Estimate(y, stds[1], valid)

    def heading(self, compass: Estimate) -> Estimate:
        """The compass heading [rad], corrected for its deviation as far as it is known."""
        value = compass.value + self._deviation.correction.at(compass.value)
        std = self._deviation.corrected_std(compass.std)
        return Estimate(wrapped(value), std, compass.valid)

    # Time update.

    def _step(self, estimate: HorizontalEstimate, interval: Interval) -> HorizontalEstimate:
        """One interval, with thrust and drag as a measurement."""
        estimate = ekf.predicted(estimate, interval, self._settings)
        if self._hull is None or interval.acceleration is None or interval.force is None:
            return estimate
        innovation = ekf.balance(estimate, interval, self._hull, self._settings)
        surprise, after = ekf.weighed(estimate, innovation)
        self._doubted = surprise > self._settings.gate**2
        return estimate if self._doubted else after

    def _close(self, at_ns: int) -> str | None:
        """Close the open interval."""
        interval = self._interval()
        self._open, self._doubted = OpenInterval(), False
        self._buffer.extend(at_ns, interval)
        if interval.force is not None and interval.acceleration is not None:
            self._balanced = True
        doubted = "outlier:vehicle/actuation" if self._doubted else None
        return self._read_out() or self._learn_deviation(at_ns, interval) or doubted

    def _learn_deviation(self, now: int, interval: Interval) -> str | None:
        """Only while both DVL and USBL are valid; one alone does not determine north."""
        if self._motion.offset is None or not (
            self._hears("usbl", now) and self._hears("dvl", now)
        ):
            self._deviation.hold()
            return None
        a, b, c = (self._values[each] for each in ekf.DEVIATION)
        std = ekf.heading_std(self._buffer.last.estimate, interval)
        heading = heading_of(interval.attitude)
        return self._deviation.follow(Coefficients(a, b, c), std, heading, interval.seconds)

    def _read_out(self) -> str | None:
        """Copy the newest estimate to plain floats, for reading at the IMU's rate."""
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
        """Of a state at the newest node."""
        return self._variances[state] ** 0.5

    def _offset(self) -> float:
        """[rad] North heading minus control heading, deviation included."""
        return (self._motion.offset or 0.0) + self._error

    # Measurement update.

    def _use(
        self, name: str, stamp_ns: int, model: MeasurementModel, restart: Correction
    ) -> str | None:
        """Correct by a sample that is not an outlier; restart from one that has no prediction to
        compare with, or after too many outliers."""
        if self._at_ns is None or self._age(stamp_ns) < -LONGEST_STEP:
            return f"ahead:sensor/{name}"
        if self._age(stamp_ns) > self._settings.oldest:
            return f"too_old:sensor/{name}"
        if not self._started:
            return self._accept(name, stamp_ns, self._begin(self._at_ns), restart)
        node = self._node(stamp_ns, self._at_ns)
        if node is None:
            return f"too_old:sensor/{name}"
        if name == "usbl" and not self._fixed:
            return self._accept(name, stamp_ns, node, restart)
        self.surprise[name] = ekf.surprise(node.estimate, model(node.estimate, node.interval))
        if self.surprise[name] <= self._settings.gate**2:
            return self._accept(name, stamp_ns, node, partial(sample_updates.update, model))
        self._outliers[name] += 1
        if self._outliers[name] < self._settings.outliers:
            return f"outlier:sensor/{name}"
        return self._accept(name, stamp_ns, node, restart) or f"restarted:{MEASURES[name]}"

    def _accept(
        self, name: str, stamp_ns: int, node: BufferNode, correction: Correction
    ) -> str | None:
        self._outliers[name] = 0
        self._heard[name] = max(stamp_ns, self._heard.get(name, stamp_ns))
        self._fixed = self._fixed or name == "usbl"
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
        self._buffer.begin(
            now, self._interval(), ekf.initial(self._settings, self._motion.heading_std)
        )
        return self._buffer.last

    def _age(self, stamp_ns: int) -> float:
        """[s] Age of a sample; 0 before the first IMU sample."""
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
        """Discard the estimate."""
        self._started = self._fixed = False
        self._heard.clear()
        return why
