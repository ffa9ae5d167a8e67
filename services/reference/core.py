"""From what the pilot says to where the drone should be.

Heave and yaw sticks are velocities: the position reference is their exact integral, so it stops
where the stick was let go. Surge and sway sticks are one force (no horizontal velocity is
measured), ramped by the same jerk law so that a change runs straight. Positions and paths can be
asked for; a deflected stick takes over at any moment. Whatever goes wrong (pilot lost, state lost,
stop), the answer is the same: come to rest, smoothly, and hold.
"""

from dataclasses import dataclass, field

import msgspec

from messages.message import Estimate, Ns
from messages.pilot import Course, PilotAnswer, PilotCommand, PilotRequest, StopDistance
from messages.reference import Reference
from messages.state import VehicleState
from messages.vehicle import Failsafe, Mode, VehicleStatus
from services.reference.answers import AnswerBook, centred, refusal
from services.reference.axes import Axes, motion, on_a_path
from services.reference.axes import Settings as Settings
from services.reference.following import Following, Planned
from services.reference.minimum_jerk import Ramp, Sample
from services.reference.paths.heading import wrap
from services.reference.position import pair

GIVE_IN_S = 0.5  # [s] time constant with which a held-back reference comes to the vehicle


class Remembered(msgspec.Struct, frozen=True):
    """What a restart in mid-dive must know."""

    armed: bool
    light: float


@dataclass(slots=True)
class Pilotage:
    """The state machine. Times `now` are int ns, `t` the same in seconds; `happened` collects
    what must be counted, `notes` what people want to know."""

    settings: Settings
    armed: bool = False
    light: float = 0.0
    stopping: bool = False  # until it stands still with the sticks centred
    happened: list[str] = field(default_factory=list[str])
    notes: list[str] = field(default_factory=list[str])
    _axes: Axes = field(init=False)
    _failsafe: Failsafe = "none"
    _running: bool = False  # the estimator has finished its calibration
    _state: VehicleState | None = None
    _t: float = 0.0  # [s] of the last reference; the reference's own time never runs backwards
    _stepped: float = 0.0  # [s] of the reference before
    _begun: bool = False
    _held_back: set[str] = field(default_factory=set[str])
    _going: bool = False  # on the way to a position that was asked for
    _planned: Planned | None = None  # a path to follow, once the drone points along it
    _following: Following | None = None
    _stop: StopDistance | None = None
    _tilting: float = 0.0  # [-] the tilt stick, as it was last heard
    _answers: AnswerBook = field(default_factory=AnswerBook)

    def __post_init__(self) -> None:
        self._axes = Axes.of(self.settings)

    # Steps.

    def step(
        self, state: VehicleState | None, command: PilotCommand | None, now: Ns
    ) -> Reference | None:
        """One reference. `state` None: none has come for too long; `command` None: no fresh one.

        Returns None as long as there has never been a state.
        """
        if state is not None:
            self._state, self._running = state, state.phase == "running"
        if self._state is None:
            return None
        self._t = max(self._t, (now if state is None else state.sensor_ns) / 1e9)
        self._watch(state, command)
        if not self.armed or not self._begun:
            self._axes.rest(self._state.depth.value, self._state.heading.value, self._t)
            self._begun = True
        self._aim(command)
        if state is not None and self.armed:
            s, axes = self.settings, self._axes
            self._wait("depth", axes.heave, state.depth, s.heave.max_error)
            self._wait("heading", axes.yaw, state.heading, s.yaw.max_error)
        self._stepped = self._t
        return self._reference(state, command, now)

    def _watch(self, state: VehicleState | None, command: PilotCommand | None) -> None:
        """Is everybody there? What was going on ends when somebody is not."""
        failsafe: Failsafe = "none"
        if state is None:
            failsafe = "state_lost"
        elif self.armed and (command is None or command.pilot == "lost"):
            failsafe = "pilot_lost"
        if failsafe != self._failsafe and failsafe != "none":
            self.happened.append(f"failsafe:{failsafe}")
            self._come_to_rest()
        self._failsafe = failsafe
        if command is not None and command.pilot == "present" and centred(command):
            self.stopping = self.stopping and not (self._following is None and self._settled())

    def _aim(self, command: PilotCommand | None) -> None:
        """Let the sticks move the axes; without them everything aims at rest."""
        t, s, axes = self._t, self.settings, self._axes
        free = self._failsafe == "none" and self.armed and not self.stopping
        if self._following is not None and self._following.ends(t):
            self._end_path()
            self.notes.append("off the path" if self.stopping else "the end of the path")
        elif command is not None and free and not centred(command):
            self._end_path()
        if self._planned is not None and self._settled():
            self._following = self._planned.begin(axes.yaw.at(t).position, t)
            self._planned = None
        busy = self._going or self._planned is not None or self._following is not None
        moves = command is not None and free and not (busy and centred(command))
        stick = command if command is not None and moves else AT_REST
        if self._following is None:
            axes.heave.aim(stick.heave * s.heave.max_velocity, t)
            axes.yaw.aim(stick.yaw * s.yaw.max_velocity, t)
        if not self.stopping:
            force = (stick.surge * s.horizontal.max_surge, stick.sway * s.horizontal.max_sway)
            axes.force.aim(force, t)
        self._tilt(stick.tilt)
        if self._going and self._settled():
            self._going = False

    def _settled(self) -> bool:
        """Depth and heading have come to where they were going."""
        return max(self._axes.heave.settles(), self._axes.yaw.settles()) <= self._t

    def _tilt(self, stick: float) -> None:
        """Up or down to the end of the range, where it stops as smoothly as anywhere."""
        tilt, s, t = self._axes.tilt, self.settings.tilt, self._t
        if stick == 0.0:
            if self._tilting != 0.0:
                tilt.brake(t)
        elif stick != self._tilting:
            here = tilt.at(t)
            end = s.highest if stick > 0 else s.lowest
            speed = abs(stick) * s.max_velocity
            plan = pair(end - here.position, s.limits, speed, here.velocity, here.acceleration)
            tilt.run(plan.segments, t)
        self._tilting = stick

    def _wait(self, name: str, ramp: Ramp, estimate: Estimate, most: float) -> None:
        """First windup guard (Andrén 2023, 5.4.1): on the sea floor the reference does not run
        away, it stays within `most` of where the vehicle really is. Once the stick is let go it
        gives in and comes to the vehicle, so that nothing pushes on for ever."""
        if not estimate.valid or self._following is not None:
            return
        here = ramp.at(self._t)
        error = here.position - estimate.value
        if abs(error) > most:
            ramp.shift(max(-most, min(most, error)) - error)
            if name not in self._held_back:
                self._held_back.add(name)
                self.happened.append(f"clamped:reference.{name}")
        elif name in self._held_back and here.velocity == 0.0 == here.acceleration:
            ramp.shift(-error * min(1.0, (self._t - self._stepped) / GIVE_IN_S))
            if abs(error) < most / 10:
                self._held_back.discard(name)
        elif abs(error) < most / 2:
            self._held_back.discard(name)

    def _reference(
        self, state: VehicleState | None, command: PilotCommand | None, now: Ns
    ) -> Reference:
        t, axes, following = self._t, self._axes, self._following
        depth, heading, pace = motion(axes.heave, t), motion(axes.yaw, t), motion(axes.pace, t)
        if following is not None:
            here, along = following.point(t), following.along(t)
            heading, pace = on_a_path(following.heading(here)), on_a_path(along)
            if following.has_depth:
                depth = on_a_path(following.depth(here))
            if state is not None:
                behind = (
                    heading.position - state.heading.value,
                    depth.position - state.depth.value,
                )
                following.watch(*behind, t)
        surge, sway = axes.force.at(t)
        return Reference(
            stamp_ns=now,
            sensor_ns=None if state is None else state.sensor_ns,
            pilot_ns=None if command is None else command.stamp_ns,
            armed=self.armed,
            depth=depth,
            heading=heading,
            surge_force=surge.velocity,
            sway_force=sway.velocity,
            surge=pace if following is not None or pace.velocity != 0.0 else None,
            tilt=motion(axes.tilt, t),
        )

    # Requests.

    def answer(
        self, request: PilotRequest, command: PilotCommand | None, now: Ns
    ) -> tuple[PilotAnswer, bool]:
        """Do what is asked or say why not. The bool: something changed.

        A request is repeated until its answer arrives; it is done once and answered each time.
        """
        if (known := self._answers.known(request, now)) is not None:
            return known, False
        reason = refusal(
            request,
            command,
            armed=self.armed,
            ready=self._running and self._failsafe != "state_lost",
            stopping=self.stopping or self._failsafe != "none",
        )
        reason = reason or self._do(request)
        return self._answers.write(request, reason, self._stop, now), not reason

    def _do(self, request: PilotRequest) -> str:
        """Do what is asked. Returns why it makes no sense, or nothing."""
        match request.kind:
            case "arm":
                self.armed = True
            case "disarm":
                self.armed = self.stopping = self._going = False
                self._end_path()
            case "stop":
                self._stop_now()
            case "light":
                if request.value is None or request.value < 0:
                    return "light needs a brightness between 0 and 1"
                self.light = request.value
            case "goto":
                if request.north is not None or request.east is not None:
                    return self._go_straight(request)
                return self._go(request.depth, request.heading)
            case "follow":
                return self._follow(request.course)
        return ""

    def _go(self, depth: float | None, heading: float | None) -> str:
        if depth is None and heading is None:
            return "goto needs a depth or a heading"
        if depth is not None and depth < 0:
            return f"{depth:g} m is above the surface"
        self._end_path()
        s, axes, t = self.settings, self._axes, self._t
        if depth is not None:
            here = axes.heave.at(t)
            way = depth - here.position
            plan = pair(way, s.heave.limits, s.heave.max_velocity, here.velocity, here.acceleration)
            axes.heave.run(plan.segments, t)
        if heading is not None:
            here = axes.yaw.at(t)
            way = wrap(heading - here.position)  # the shortest way
            plan = pair(way, s.yaw.limits, s.yaw.max_velocity, here.velocity, here.acceleration)
            axes.yaw.run(plan.segments, t)
        self._going = True
        return ""

    def _go_straight(self, request: PilotRequest) -> str:
        """To a place, along a straight line from where the drone is measured to be."""
        if request.north is None or request.east is None or request.heading is not None:
            return "goto a place needs north and east, and turns there by itself"
        state = self._state
        north, east = (None, None) if state is None else (state.north, state.east)
        if north is None or east is None or not (north.valid and east.valid):
            return "this drone does not know its position"
        depth = self._axes.heave.at(self._t).position
        end = depth if request.depth is None else request.depth
        if end < 0:
            return f"{end:g} m is above the surface"
        here, there = (north.value, east.value, depth), (request.north, request.east, end)
        return self._follow(Course(waypoints=(here, there)))

    def _follow(self, course: Course | None) -> str:
        if course is None:
            return "follow needs a path"
        try:
            planned = Planned(course)
        except ValueError as error:
            return f"this is no path: {error}"
        heading = planned.first_heading(self._axes.yaw.at(self._t).position)
        self._go(planned.first_depth if planned.has_depth else None, heading)
        self._going, self._planned = False, planned
        return ""

    def _stop_now(self) -> None:
        """Come to rest by the stop's own limits, along a path if there is one."""
        t, s, axes = self._t, self.settings, self._axes
        self.stopping, self._going, self._planned = True, False, None
        axes.force.aim((0.0, 0.0), t, s.horizontal.stop)
        if self._following is not None:
            here = self._following.point(t)
            self._following, end = self._following.stop(s.heave.stop, t)
            there = self._following.point(end)
            self._stop = StopDistance(there.down - here.down, there.heading - here.heading, end - t)
            return
        axes.heave.brake(t, s.heave.stop)
        axes.yaw.brake(t, s.yaw.stop)
        seconds = max(axes.heave.settles(), axes.yaw.settles()) - t
        self._stop = StopDistance(axes.heave.to_go(t), axes.yaw.to_go(t), seconds)

    def _come_to_rest(self) -> None:
        """From the way to a position, or along a path."""
        if self._following is not None:
            self._following, _ = self._following.stop(self.settings.heave.limits, self._t)
        elif self._going or self._planned is not None:
            self._axes.heave.brake(self._t)
            self._axes.yaw.brake(self._t)
        self._going, self._planned = False, None

    def _end_path(self) -> None:
        """Hand the motion along a path to the axes, without a step."""
        t, axes, following = self._t, self._axes, self._following
        if self._planned is not None:
            axes.heave.brake(t)
            axes.yaw.brake(t)
        self._planned = self._following = None
        if following is None:
            return
        here = following.point(t)
        axes.yaw.take(following.heading(here), t)
        if following.has_depth:
            axes.heave.take(following.depth(here), t)
        along = following.along(t)
        axes.pace.take(Sample(0.0, along.velocity, along.acceleration, along.jerk), t)

    # What is said of it.

    def status(self, command: PilotCommand | None, now: Ns) -> VehicleStatus:
        return VehicleStatus(
            stamp_ns=now,
            mode=self.mode,
            armed=self.armed,
            failsafe=self._failsafe,
            pilot="" if command is None else command.source,
            light=self.light,
            note="" if self._running else "calibrating: keep the drone still",
            stop=self._stop if self.stopping else None,
        )

    @property
    def mode(self) -> Mode:
        if not self.armed:
            return "ready" if self._running else "starting"
        if self.stopping:
            return "stopping"
        if self._planned is not None or self._following is not None:
            return "follow"
        return "goto" if self._going else "piloted"


AT_REST = PilotCommand(stamp_ns=0, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
