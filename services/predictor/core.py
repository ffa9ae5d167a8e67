"""The drone's present state, predicted from a newest state that is a link delay old.

The drone follows its reference, and the reference follows a known law. So the newest reference that
arrived is propagated by the same law, with the stick positions that have reached the drone since.
How far off past predictions were is measured with the states that arrive later.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, exp, hypot, sin, sqrt
from statistics import median
from typing import NamedTuple

from messages.message import Estimate
from messages.pilot import PilotCommand
from messages.reference import Motion, Reference
from messages.state import Miss, Prediction, VehicleState
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.marine.attitude import level_velocity, north_offset
from services.marine.summation import plain_sum
from services.marine.vehicle import Vehicle
from services.reference.settings import Settings, VelocityAxis
from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample

CATCH_UP = 0.5  # [s] time constant with which the vehicle's rate error decays


@dataclass(frozen=True, slots=True)
class Change:
    """A stick position on the link."""

    at: float  # [s] when the drone acts on it
    target: float  # per second


def reference_ahead(
    motion: Motion, begun: float, changes: Sequence[Change], limits: Limits, until: float
) -> Sample:
    """The reference at time `until`, from what it was at `begun` [s].

    Args:
        motion: the newest reference that has arrived.
        changes: stick positions in the order of their effect. The first is the one that the
            reference already includes.
    """
    ramp = Ramp(limits)
    ramp.take(Sample(motion.position, motion.velocity, motion.acceleration, motion.jerk), begun)
    for change in changes:
        if change.at >= until:
            break
        ramp.aim(change.target, max(change.at, begun))
    return ramp.at(until)


def coasting(motion: Motion, seconds: float) -> Sample:
    """Extrapolation with constant jerk, for a reference along a path or a turn."""
    v, a, j = motion.velocity, motion.acceleration, motion.jerk
    velocity = v + seconds * (a + seconds * j / 2)
    position = motion.position + seconds * (v + seconds * (a / 2 + seconds * j / 6))
    return Sample(position, velocity, a + seconds * j, j)


def joined(
    ahead: Sample, motion: Motion, position: float, rate: float, seconds: float
) -> tuple[float, float]:
    """Position and rate of the vehicle: its position error stays, its rate error decays.

    Args:
        ahead: predicted reference.
        motion: reference `seconds` before.
        position, rate: of the vehicle at that time.
    """
    rate_error, decay = rate - motion.velocity, exp(-seconds / CATCH_UP)
    error = position - motion.position + rate_error * CATCH_UP * (1.0 - decay)
    return ahead.position + error, ahead.velocity + rate_error * decay


STEP = 0.02  # [s]


@dataclass(slots=True)
class Drift:
    """Model of one body axis, driven by the reference forces that arrive."""

    inertia: float  # [kg] with added mass
    linear: float  # [N s/m]
    quadratic: float  # [N s²/m²]
    velocity: float = 0.0  # [m/s]

    @classmethod
    def of(cls, vehicle: Vehicle, axis: int) -> "Drift":
        """0 for surge, 1 for sway."""
        return cls(
            vehicle.mass + vehicle.added_mass[axis],
            vehicle.linear_damping[axis],
            vehicle.quadratic_damping[axis],
        )

    def go(self, force: float, seconds: float) -> float:
        """[m] Displacement while this force [N] acts; the velocity is kept for the next call."""
        steps = max(1, round(seconds / STEP))
        dt, moved = seconds / steps, 0.0
        for _ in range(steps):
            v = self.velocity
            drag = self.linear + self.quadratic * abs(v)
            # Implicit in the drag, so that any step is stable.
            self.velocity = (self.inertia * v + force * dt) / (self.inertia + drag * dt)
            moved += (v + self.velocity) / 2 * dt
        return moved


WINDOW_NS = 5_000_000_000  # [ns] of judged predictions


class Pose(NamedTuple):
    depth: float  # [m]
    heading: float  # [rad] accumulates
    north: float | None  # [m]
    east: float | None  # [m]


class JudgedPrediction(NamedTuple):
    """A prediction, and the delayed state it was made from."""

    at: Ns  # [ns] the time it predicts
    predicted: Pose
    delayed: Pose


Errors = tuple[float, float, float | None]  # [m², rad², m²] squared: depth, heading, place


@dataclass(slots=True)
class PredictionQuality:
    _pending: deque[JudgedPrediction] = field(default_factory=deque[JudgedPrediction])
    _judged: deque[tuple[Ns, Errors, Errors]] = field(
        default_factory=deque[tuple[int, Errors, Errors]]
    )
    _before: tuple[Ns, Pose] | None = None  # the previous state

    def predicted(self, judged: JudgedPrediction) -> None:
        self._pending.append(judged)

    def truth(self, at: Ns, pose: Pose) -> None:
        """The drone's state at `at` [ns]; call in order of time."""
        before, self._before = self._before, (at, pose)
        while self._pending and self._pending[0].at <= at:
            judged = self._pending.popleft()
            if before is not None and before[0] <= judged.at:
                true = _between(before, (at, pose), judged.at)
                errors = _errors(judged.predicted, true), _errors(judged.delayed, true)
                self._judged.append((at, *errors))
        while self._judged and self._judged[0][0] < at - WINDOW_NS:
            self._judged.popleft()

    def misses(self) -> tuple[Miss | None, Miss | None]:
        """Rms errors of the predictions, and of the delayed state."""
        if not self._judged:
            return None, None
        _, predicted, delayed = zip(*self._judged, strict=True)
        return _rms(predicted), _rms(delayed)


def _between(before: tuple[Ns, Pose], after: tuple[Ns, Pose], at: Ns) -> Pose:
    (t0, p0), (t1, p1) = before, after
    share = (at - t0) / (t1 - t0) if t1 > t0 else 1.0

    def mixed(a: float | None, b: float | None) -> float | None:
        return None if a is None or b is None else a + share * (b - a)

    depth = p0.depth + share * (p1.depth - p0.depth)
    heading = p0.heading + share * (p1.heading - p0.heading)
    return Pose(depth, heading, mixed(p0.north, p1.north), mixed(p0.east, p1.east))


def _errors(judged: Pose, true: Pose) -> Errors:
    depth, heading, place = judged.depth - true.depth, judged.heading - true.heading, None
    if (off_north := _off(judged.north, true.north)) is not None and (
        off_east := _off(judged.east, true.east)
    ) is not None:
        distance = hypot(off_north, off_east)
        place = distance * distance
    return depth * depth, heading * heading, place


def _off(judged: float | None, true: float | None) -> float | None:
    return None if judged is None or true is None else judged - true


def _rms(errors: Sequence[Errors]) -> Miss:
    depths, headings, places = zip(*errors, strict=True)
    known = [place for place in places if place is not None]
    return Miss(
        depth=_root_mean(depths),
        heading=_root_mean(headings),
        place=_root_mean(known) if known else None,
    )


def _root_mean(squares: Sequence[float]) -> float:
    return sqrt(plain_sum(squares) / len(squares))


COMMANDS = 200  # changes of the sticks kept; at least four seconds
DELAYS = 50  # commands whose median delay is used
LONGEST_S = 2.0  # [s] nothing is predicted further ahead


@dataclass(slots=True)
class Predictor:
    """Takes commands, states and references as they arrive; all stamps in local time."""

    settings: Settings
    vehicle: Vehicle
    _quality: PredictionQuality = field(default_factory=PredictionQuality)
    _commands: deque[PilotCommand] = field(
        default_factory=lambda: deque[PilotCommand](maxlen=COMMANDS)
    )
    _delays: deque[int] = field(default_factory=lambda: deque[int](maxlen=DELAYS))
    _state: VehicleState | None = None
    _reference: Reference | None = None
    _piloted: bool = False
    _surge: Drift = field(init=False)
    _sway: Drift = field(init=False)
    _last_pilot_ns: Ns | None = None

    def __post_init__(self) -> None:
        self._surge, self._sway = Drift.of(self.vehicle, 0), Drift.of(self.vehicle, 1)

    def command(self, command: PilotCommand, _: Ns) -> None:
        """Keep a command if its sticks differ from those of the previous one."""
        if not self._commands or _sticks(command) != _sticks(self._commands[-1]):
            self._commands.append(command)

    def status(self, status: VehicleStatus, _: Ns) -> None:
        self._piloted = status.activity == "piloted" and status.failsafe == "none"

    def reference(self, reference: Reference, _: Ns) -> None:
        before, self._reference = self._reference, reference
        if before is not None:
            seconds = min(0.5, max(0.0, (reference.stamp_ns - before.stamp_ns) / 1e9))
            self._surge.go(reference.surge_force, seconds)
            self._sway.go(reference.sway_force, seconds)
        pilot_ns = reference.pilot_ns
        if pilot_ns is not None and pilot_ns != self._last_pilot_ns:
            self._last_pilot_ns = pilot_ns
            self._delays.append(reference.stamp_ns - pilot_ns)

    def state(self, state: VehicleState, _: Ns) -> None:
        self._state = state
        if state.phase == "running":
            self._quality.truth(state.sensor_ns, _pose(state))
        if (level := level_velocity(state)) is not None:
            self._surge.velocity, self._sway.velocity = level

    def predict(self, now: Ns) -> Prediction | None:
        """The prediction; None while there is no state to start from, or it is too old."""
        state, reference = self._state, self._reference
        if state is None or reference is None or state.phase != "running":
            return None
        seconds = (now - state.sensor_ns) / 1e9
        if not 0.0 <= seconds <= LONGEST_S:
            return None
        depth, depth_rate = self._axis(
            reference.depth, reference, self.settings.heave, "heave", state.depth,
            state.depth_rate, now,
        )  # fmt: skip
        heading, yaw_rate = self._axis(
            reference.heading, reference, self.settings.yaw, "yaw", state.heading,
            state.yaw_rate, now,
        )  # fmt: skip
        forward, starboard = self._displacement(reference, seconds)
        middle = (state.heading.value + heading) / 2 + north_offset(state)
        north, east = _moved(state, middle, forward, starboard)
        self._quality.predicted(
            JudgedPrediction(now, Pose(depth, heading, north, east), _pose(state))
        )
        missed, delayed = self._quality.misses()
        return Prediction(
            stamp_ns=now,
            state_ns=state.sensor_ns,
            ahead_ms=seconds * 1e3,
            depth=depth,
            heading=heading,
            depth_rate=depth_rate,
            yaw_rate=yaw_rate,
            forward=forward,
            starboard=starboard,
            north=north,
            east=east,
            missed=missed,
            delayed=delayed,
        )

    def _axis(
        self,
        motion: Motion,
        reference: Reference,
        axis: VelocityAxis,
        stick: str,
        position: Estimate,
        rate: Estimate,
        now: Ns,
    ) -> tuple[float, float]:
        """Predicted position and rate of one axis."""
        begun, seconds = reference.stamp_ns / 1e9, (now - reference.stamp_ns) / 1e9
        if not reference.armed:
            ahead = Sample(motion.position, 0.0, 0.0, 0.0)
        elif self._piloted:
            ahead = reference_ahead(
                motion, begun, self._changes(stick, axis, reference), axis.limits, now / 1e9
            )
        else:
            ahead = coasting(motion, max(0.0, seconds))
        return joined(ahead, motion, position.value, rate.value, max(0.0, seconds))

    def _changes(self, stick: str, axis: VelocityAxis, reference: Reference) -> list[Change]:
        """The stick positions that the reference does not include yet, with the time of effect."""
        delay = median(self._delays) if self._delays else 0.0
        included = reference.pilot_ns or 0
        changes: list[Change] = []
        for command in self._commands:
            target = getattr(command, stick) * axis.max_velocity
            if command.stamp_ns <= included:
                changes = [Change(0.0, target)]
            else:
                changes.append(Change((command.stamp_ns + delay) / 1e9, target))
        return changes

    def _displacement(self, reference: Reference, seconds: float) -> tuple[float, float]:
        """[m] Forward and to starboard since the state, by the reference's horizontal forces."""
        if reference.surge is not None:
            return reference.surge.velocity * seconds, 0.0
        surge = Drift.of(self.vehicle, 0)
        sway = Drift.of(self.vehicle, 1)
        surge.velocity, sway.velocity = self._surge.velocity, self._sway.velocity
        return surge.go(reference.surge_force, seconds), sway.go(reference.sway_force, seconds)


def _sticks(command: PilotCommand) -> tuple[float, float]:
    return command.heave, command.yaw


def _pose(state: VehicleState) -> Pose:
    north = state.north.value if state.north is not None and state.north.valid else None
    east = state.east.value if state.east is not None and state.east.valid else None
    return Pose(state.depth.value, state.heading.value, north, east)


def _moved(
    state: VehicleState, heading: float, forward: float, starboard: float
) -> tuple[float | None, float | None]:
    """[m] North and east after this displacement at a heading [rad] clockwise from north; None
    where the position is not measured."""
    pose = _pose(state)
    if pose.north is None or pose.east is None:
        return None, None
    c, s = cos(heading), sin(heading)
    return pose.north + c * forward - s * starboard, pose.east + s * forward + c * starboard
