"""From what the pilot says to where the drone should be.

Heave and yaw sticks are velocities: the position reference is their exact integral, so it stops
where the stick was let go. Surge and sway sticks are forces (no horizontal velocity is measured),
ramped by the same jerk law. Whatever happens (pilot lost, state lost, stop), the answer is the
same: aim at zero, smoothly, and hold.
"""

from dataclasses import dataclass, field
from typing import Annotated

import msgspec

from messages.message import Estimate, Ns
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.vehicle import Failsafe, Mode, VehicleStatus
from services.reference.minimum_jerk import Limits, Ramp, Sample

Above0 = Annotated[float, msgspec.Meta(gt=0.0)]
GIVE_IN_S = 0.5  # [s] time constant with which a held-back reference comes to the vehicle
ANSWERS = 64  # requests whose answers are known by heart
CENTRED = 0.05  # [-] a stick this close to the middle counts as let go


class VelocityAxis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A stick that is a velocity, with its position integral."""

    max_velocity: Above0  # per s, at full stick
    max_acceleration: Above0  # per s²
    jerk: Above0  # per s³
    max_error: Above0  # position units; the reference waits for a vehicle that is held back

    @property
    def limits(self) -> Limits:
        return Limits(self.jerk, self.max_acceleration)


class ForceAxis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A stick that is a force."""

    max_force: Above0  # [N] at full stick
    max_rate: Above0  # [N/s]
    max_rate_change: Above0  # [N/s²] plays the part of the jerk

    @property
    def limits(self) -> Limits:
        return Limits(self.max_rate_change, self.max_rate)


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    heave: VelocityAxis = VelocityAxis(0.5, 0.5, 1.5, 0.2)  # [m]
    yaw: VelocityAxis = VelocityAxis(1.05, 1.5, 4.0, 0.5)  # [rad]
    surge: ForceAxis = ForceAxis(30.0, 40.0, 120.0)
    sway: ForceAxis = ForceAxis(20.0, 40.0, 120.0)


class Remembered(msgspec.Struct, frozen=True):
    """What a restart in mid-dive must know."""

    armed: bool
    light: float


@dataclass(slots=True)
class Axes:
    heave: Ramp
    yaw: Ramp
    surge: Ramp
    sway: Ramp


@dataclass(slots=True)
class Pilotage:
    """The state machine. Times `now` are int ns; `happened` collects what must be counted."""

    settings: Settings
    armed: bool = False
    light: float = 0.0
    stopping: bool = False  # a stop was asked for and the sticks were not centred since
    happened: list[str] = field(default_factory=list[str])
    _failsafe: Failsafe = "none"
    _running: bool = False  # the estimator has finished its calibration
    _state: VehicleState | None = None
    _axes: Axes = field(init=False)
    _last: Ns = 0  # [ns] of the last reference; the reference's own time never runs backwards
    _stepped: float = 0.0  # [s] time of the reference before
    _held_back: set[str] = field(default_factory=set[str])
    _begun: bool = False
    _answers: dict[str, PilotAnswer] = field(default_factory=dict[str, PilotAnswer])

    def __post_init__(self) -> None:
        s = self.settings
        self._axes = Axes(
            Ramp(s.heave.limits), Ramp(s.yaw.limits), Ramp(s.surge.limits), Ramp(s.sway.limits)
        )

    def step(
        self, state: VehicleState | None, command: PilotCommand | None, now: Ns
    ) -> Reference | None:
        """One reference. `state` None: none has come for too long; `command` None: no fresh one.

        Returns None as long as there has never been a state.
        """
        self._observe(state, command)
        if self._state is None:
            return None
        self._last = max(self._last, now if state is None else state.sensor_ns)
        t = self._last / 1e9
        if not self.armed or not self._begun:
            self._follow(self._state, t)
        self._aim(command, t)
        if state is not None and self.armed:
            s, axes = self.settings, self._axes
            self._wait("depth", axes.heave, state.depth, s.heave.max_error, t)
            self._wait("heading", axes.yaw, state.heading, s.yaw.max_error, t)
        self._stepped = t
        return self._reference(state, command, now, t)

    def answer(
        self, request: PilotRequest, command: PilotCommand | None, now: Ns
    ) -> tuple[PilotAnswer, bool]:
        """Do what is asked or say why not. The bool: something changed.

        A request is repeated until its answer arrives; it is done once and answered each time.
        """
        if request.id in self._answers:
            return msgspec.structs.replace(self._answers[request.id], stamp_ns=now), False
        reason = self._refusal(request, command)
        if not reason:
            self._do(request)
        answer = PilotAnswer(
            stamp_ns=now,
            id=request.id,
            accepted=not reason,
            reason=reason,
            cause_ns=request.stamp_ns,
        )
        self._answers[request.id] = answer
        if len(self._answers) > ANSWERS:
            del self._answers[next(iter(self._answers))]
        return answer, not reason

    def status(self, command: PilotCommand | None, now: Ns) -> VehicleStatus:
        return VehicleStatus(
            stamp_ns=now,
            mode=self.mode,
            armed=self.armed,
            failsafe=self._failsafe,
            pilot="" if command is None else command.source,
            light=self.light,
            note="" if self._running else "calibrating: keep the drone still",
        )

    @property
    def mode(self) -> Mode:
        if not self.armed:
            return "ready" if self._running else "starting"
        return "stopping" if self.stopping else "piloted"

    def _observe(self, state: VehicleState | None, command: PilotCommand | None) -> None:
        if state is not None:
            self._state = state
            self._running = state.phase == "running"
        if self._state is not None and state is None:
            self._become("state_lost")
        elif self.armed and (command is None or command.pilot == "lost"):
            self._become("pilot_lost")
        else:
            self._become("none")
        if command is not None and command.pilot == "present" and _centred(command):
            self.stopping = False

    def _become(self, failsafe: Failsafe) -> None:
        if failsafe != self._failsafe and failsafe != "none":
            self.happened.append(f"failsafe:{failsafe}")
        self._failsafe = failsafe

    def _follow(self, state: VehicleState, t: float) -> None:
        """Disarmed: the reference is wherever the vehicle is, at rest, so arming has no jump."""
        self._axes.heave.rest(state.depth.value, t)
        self._axes.yaw.rest(state.heading.value, t)
        self._axes.surge.rest(0.0, t)
        self._axes.sway.rest(0.0, t)
        self._begun = True

    def _aim(self, command: PilotCommand | None, t: float) -> None:
        s, axes = self.settings, self._axes
        if self._failsafe != "none" or self.stopping or not self.armed or command is None:
            heave = yaw = surge = sway = 0.0
        else:
            heave, yaw = command.heave * s.heave.max_velocity, command.yaw * s.yaw.max_velocity
            surge, sway = command.surge * s.surge.max_force, command.sway * s.sway.max_force
        axes.heave.aim(heave, t)
        axes.yaw.aim(yaw, t)
        axes.surge.aim(surge, t)
        axes.sway.aim(sway, t)

    def _wait(self, name: str, ramp: Ramp, estimate: Estimate, most: float, t: float) -> None:
        """First windup guard (Andrén 2023, 5.4.1): on the sea floor the reference does not run
        away, it stays within `most` of where the vehicle really is. Once the stick is let go it
        gives in and comes to the vehicle, so that nothing pushes on for ever."""
        if not estimate.valid:
            return
        here = ramp.at(t)
        error = here.position - estimate.value
        if abs(error) > most:
            ramp.shift(max(-most, min(most, error)) - error)
            if name not in self._held_back:
                self._held_back.add(name)
                self.happened.append(f"clamped:reference.{name}")
        elif name in self._held_back and here.velocity == 0.0 == here.acceleration:
            ramp.shift(-error * min(1.0, (t - self._stepped) / GIVE_IN_S))
            if abs(error) < most / 10:
                self._held_back.discard(name)
        elif abs(error) < most / 2:
            self._held_back.discard(name)

    def _reference(
        self, state: VehicleState | None, command: PilotCommand | None, now: Ns, t: float
    ) -> Reference:
        axes = self._axes
        return Reference(
            stamp_ns=now,
            sensor_ns=None if state is None else state.sensor_ns,
            pilot_ns=None if command is None else command.stamp_ns,
            armed=self.armed,
            depth=_motion(axes.heave.at(t)),
            heading=_motion(axes.yaw.at(t)),
            surge_force=axes.surge.at(t).velocity,
            sway_force=axes.sway.at(t).velocity,
        )

    def _refusal(self, request: PilotRequest, command: PilotCommand | None) -> str:
        """Why a request cannot be granted; empty when it can."""
        if request.kind == "arm" and not self.armed:
            if not self._running or self._failsafe == "state_lost":
                return "the drone does not know its depth and attitude yet"
            if command is None or command.pilot == "lost":
                return "no pilot: no fresh stick positions arrive"
            if not _centred(command):
                return "the sticks are not centred"
        if request.kind == "light" and (request.value is None or request.value < 0):
            return "light needs a brightness between 0 and 1"
        return ""

    def _do(self, request: PilotRequest) -> None:
        match request.kind:
            case "arm":
                self.armed = True
            case "disarm":
                self.armed, self.stopping = False, False
            case "stop":
                self.stopping = True
            case "light":
                self.light = request.value or 0.0


def _centred(command: PilotCommand) -> bool:
    return max(map(abs, (command.surge, command.sway, command.heave, command.yaw))) < CENTRED


def _motion(sample: Sample) -> Motion:
    return Motion(*sample)
