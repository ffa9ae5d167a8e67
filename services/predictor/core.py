"""The drone's present state, predicted from a newest state that is a link delay old.

The drone follows its reference, and the reference follows a known law. So the newest reference that
arrived is propagated by the same law, with the stick positions that have reached the drone since.
Over the ground it goes on as it was measured, or as its path says.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import exp
from statistics import median

from messages.message import Estimate
from messages.pilot import PilotCommand
from messages.reference import Motion, Reference
from messages.state import Prediction, VehicleState
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.marine.attitude import level_velocity, north_offset, turned
from services.reference.settings import Settings, VelocityAxis
from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample, Segment

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
    segment = Segment(seconds, motion.velocity, motion.acceleration, motion.jerk, 0.0)
    moved = segment.at(seconds)
    return moved._replace(position=motion.position + moved.position)


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


COMMANDS = 200  # changes of the sticks kept; at least four seconds
DELAYS = 50  # commands whose median delay is used
LONGEST_S = 2.0  # [s] nothing is predicted further ahead


@dataclass(slots=True)
class Predictor:
    """Takes commands, states and references as they arrive; all stamps in local time."""

    settings: Settings
    _commands: deque[PilotCommand] = field(
        default_factory=lambda: deque[PilotCommand](maxlen=COMMANDS)
    )
    _delays: deque[int] = field(default_factory=lambda: deque[int](maxlen=DELAYS))
    _state: VehicleState | None = None
    _reference: Reference | None = None
    _piloted: bool = False
    _last_pilot_ns: Ns | None = None

    def command(self, command: PilotCommand, _: Ns) -> None:
        """Keep a command if its sticks differ from those of the previous one."""
        if not self._commands or _sticks(command) != _sticks(self._commands[-1]):
            self._commands.append(command)

    def status(self, status: VehicleStatus, _: Ns) -> None:
        self._piloted = status.activity == "piloted" and status.failsafe == "none"

    def reference(self, reference: Reference, _: Ns) -> None:
        self._reference, pilot_ns = reference, reference.pilot_ns
        if pilot_ns is not None and pilot_ns != self._last_pilot_ns:
            self._last_pilot_ns = pilot_ns
            self._delays.append(reference.stamp_ns - pilot_ns)

    def state(self, state: VehicleState, _: Ns) -> None:
        self._state = state

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
        ahead, aside = level_velocity(state) or (0.0, 0.0)
        if reference.surge is not None:
            ahead, aside = reference.surge.velocity, 0.0
        moved = forward, starboard = ahead * seconds, aside * seconds
        place = state.north, state.east
        by = turned(moved, (state.heading.value + heading) / 2 + north_offset(state))
        north, east = (
            at.value + way if at is not None and at.valid else None
            for at, way in zip(place, by, strict=True)
        )
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


def _sticks(command: PilotCommand) -> tuple[float, float]:
    return command.heave, command.yaw
