"""The drone's present state, predicted from a newest state that is a link delay old.

The drone follows its reference, and the reference follows a known law. So the newest reference that
arrived is propagated by the same law, with the stick positions that have reached the drone since.
"""

from collections import deque
from dataclasses import dataclass, field
from math import cos, sin
from statistics import median

from messages.message import Estimate
from messages.pilot import PilotCommand
from messages.prediction import Prediction
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.marine.attitude import level_velocity, north_offset
from services.marine.vehicle import Vehicle
from services.predictor.prediction_quality import JudgedPrediction, Pose, PredictionQuality
from services.predictor.reference_ahead import Change, Drift, coasting, joined, reference_ahead
from services.reference.settings import Settings, VelocityAxis
from services.reference.trajectory.minimum_jerk import Sample

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
