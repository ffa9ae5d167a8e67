"""From pilot commands to the reference.

The mode (`modes.py`) says which axes the drone holds. The sticks of held axes are velocities; the
position reference is their exact integral. The sticks of the other axes are forces, ramped by the
same jerk-bounded law. The pilot can request positions and paths; a deflected stick overrides them
at any moment. What the drone does by itself when something fails is the failsafe table
(`failsafe/`): come to rest smoothly and hold, rise, stay at the surface.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar, cast

import msgspec
from msgspec import UNSET, UnsetType

from messages import events
from messages.events import Outbox, sentence
from messages.pilot import FlightMode, PilotAnswer, PilotCommand, PilotRequest, StopDistance
from messages.reference import Reference
from messages.state import VehicleState
from messages.units import Ns, Outputs
from messages.vehicle import Activity, Failsafe, PlaceAhead, VehicleStatus
from services.marine.outputs import OUTPUTS, Output
from services.marine.sensor_time import SensorTime
from services.reference.failsafe.machine import FailsafeMachine, Memory
from services.reference.failsafe.table import table
from services.reference.failsafe.watch import ConditionWatch
from services.reference.guidance import requests
from services.reference.guidance.authority import ControlAuthority, Lease
from services.reference.guidance.axes import CentredSticks, centred
from services.reference.guidance.ground_motion import Home, HomePlace, whereabouts
from services.reference.guidance.guidance import Guidance
from services.reference.guidance.modes import lacking
from services.reference.guidance.pilot_outputs import PilotOutputs
from services.reference.guidance.requests import refusal
from services.reference.settings import Settings as Settings
from services.reference.trajectory.own_law import Law

AT_REST = PilotCommand(stamp_ns=0, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)


class GuidanceCheckpoint(msgspec.Struct, frozen=True):
    """State that a restart in mid-dive needs."""

    armed: bool = False
    outputs: Outputs = {}  # of dimmers and switches
    flight_mode: FlightMode = "stabilised"  # in force
    asked: FlightMode = "stabilised"  # requested by the pilot
    lease: Lease = Lease()
    failsafes: dict[str, Memory] = {}
    surfaced: bool = False
    armed_ns: int = 0  # [ns] stamp of the newest arm, later than every disarm before it
    disarmed_ns: int = 0  # [ns] stamp of the newest disarm
    home: HomePlace | None = None
    home_lost: bool = False


SHORT_OF_YAW = 0.01  # [-] of the yaw moment that is wanted; a smaller lack is rounding
INITIAL = GuidanceCheckpoint()
K = TypeVar("K")


def _known(value: K | None) -> K | UnsetType:
    return UNSET if value is None else value


@dataclass(slots=True)
class ReferenceGenerator:
    """The state machine. Times `now` are int ns."""

    settings: Settings
    outbox: Outbox
    before: GuidanceCheckpoint = INITIAL
    started_ns: Ns = 0  # [ns] now
    watched: Mapping[str, str] = field(default_factory=dict[str, str])  # service → its role
    has: tuple[Output, ...] = OUTPUTS  # outputs of the vehicle
    law: Law | None = None  # of the user's, for depth and heading
    armed: bool = field(init=False)
    outputs: PilotOutputs = field(init=False)
    requested: FlightMode = field(init=False)  # by the pilot; in force again after a disarm
    authority: ControlAuthority = field(init=False)
    conditions: ConditionWatch = field(init=False)  # of the failsafes
    stopping: bool = False  # until at rest with the sticks centred
    _mode_at_rest: FlightMode | None = None  # asked for while stopping
    _guidance: Guidance = field(init=False)
    _time: SensorTime = field(default_factory=SensorTime)  # of the reference
    _failsafes: FailsafeMachine = field(init=False)
    _centring: CentredSticks = field(default_factory=CentredSticks)
    _acts: bool = False  # a failsafe acted at the newest step
    _running: bool = False  # the estimator has finished its calibration
    _silent: bool = False  # the estimator
    _initialised: bool = False
    _stop: StopDistance | None = None
    _armed_ns: Ns = field(init=False)
    _disarmed_ns: Ns = field(init=False)

    def __post_init__(self) -> None:
        b = self.before
        self.armed, self.requested = b.armed, b.asked
        self.outputs = PilotOutputs(self.has, b.outputs, self.started_ns)
        self._armed_ns, self._disarmed_ns = b.armed_ns, b.disarmed_ns
        self.authority = ControlAuthority(b.lease, self.started_ns)
        self._guidance = Guidance(self.settings, self.outbox, b.flight_mode, self.law)
        self._guidance.home = Home(b.home, b.home_lost)
        rows, memory = table(self.settings.failsafe), dict(b.failsafes)
        self._failsafes = FailsafeMachine(rows, self.outbox, memory, b.armed, b.surfaced)
        self.conditions = ConditionWatch(self.settings.failsafe, self.watched, self.started_ns)

    @property
    def checkpoint(self) -> GuidanceCheckpoint:
        return GuidanceCheckpoint(
            self.armed,
            self.outputs.values,
            self._guidance.flight_mode,
            self.requested,
            self.authority.lease,
            dict(self._failsafes.memory),
            self._failsafes.surfaced,
            self._armed_ns,
            self._disarmed_ns,
            self._guidance.home.place,
            self._guidance.home.lost,
        )

    # Steps.

    def step(
        self, state: VehicleState | None, command: PilotCommand | None, now: Ns
    ) -> Reference | None:
        """One reference. `state` None: timed out; `command` None: no fresh one.

        Returns None until the first state has arrived.
        """
        guidance, failsafes, s = self._guidance, self._failsafes, self.settings.failsafe
        self._silent = state is None
        if state is not None:
            self._running = state.phase == "running"
        guidance.see(state, self._time.step(None if state is None else state.sensor_ns, now) / 1e9)
        self._keep_home(state)
        newest = self.conditions.newest
        guidance.bottom.see(newest.dvl, state, guidance.t, newest.altimeter)
        if guidance.state is None:
            self.outputs.step(command, now, armed=self.armed, free=False)
            return None

        # What the failsafe table says; a condition that begins to act ends the manoeuvre.
        holding = self.conditions.holding(
            state,
            command,
            guidance.unheld if self.armed else (),
            now,
            armed=self.armed,
            limited=self.armed and guidance.axes.limited,
            above_floor=self.armed and guidance.near_floor,
        )
        at_surface = self._initialised and guidance.has_risen(s.surface_depth)
        unknown = self.conditions.unknown
        lease = self.authority.lease
        failsafes.step(
            *(holding, now),
            armed=self.armed,
            at_surface=at_surface,
            unknown=unknown,
            pilot=(lease.acting, lease.epoch),
        )
        if self._centring.step(command if failsafes.resumable else None, now):
            failsafes.give_back()
        reaction = failsafes.reaction
        acted, self._acts = self._acts, reaction is not None
        if self._acts and not acted:
            guidance.come_to_rest()
        # Without a state no ascent goes on, because the thrusters are off and the reference would
        # leave the drone behind.
        if reaction in ("ascend", "surface") and state is not None:
            guidance.rise(s.surface_depth, s.ascent_speed)
        else:
            guidance.end_rise()
        if command is not None and command.pilot == "present" and centred(command):
            self._end_stop()

        # The axes at this instant, and where they go on to.
        if self.armed and self._initialised:
            guidance.move_on(state)
            # A height that was given up by itself does not come back, not even by arming again.
            lasts = self.requested != "altitude_hold"
            self.requested = self.requested if lasts else guidance.flight_mode
        else:
            guidance.rest()
            self._initialised = True
        self._aim(command)
        self.outputs.step(command, now, armed=self.armed, free=self._obeys_sticks)

        # The reference waits for a vehicle that cannot follow, sooner where the thrusters are at
        # a limit and give less yaw than control asks for.
        if state is not None and self.armed:
            turn_short, wrench = False, self.conditions.newest.wrench
            if wrench is not None and wrench.saturated:
                wanted, achieved = wrench.wanted[5], wrench.achieved[5]
                turn_short = abs(wanted - achieved) > SHORT_OF_YAW * abs(wanted)
            guidance.wait(state, turn_short=turn_short)
        armed_ns = self._armed_ns if self.armed else None
        return guidance.reference(
            *(state, command, now),
            armed_ns=armed_ns,
            epoch=lease.acting,
            gripper=self.outputs.gripper,
        )

    def _keep_home(self, state: VehicleState | None) -> None:
        guidance, home = self._guidance, self._guidance.home
        was_lost = home.lost
        home.see(state, guidance.ground, guidance.t, armed=self.armed)
        if home.lost and not was_lost:
            self.outbox.say("warning", home.missing)

    @property
    def _obeys_sticks(self) -> bool:
        return self.armed and not (self._acts or self.stopping)

    def _aim(self, command: PilotCommand | None) -> None:
        """Set the axes' targets from the sticks; without sticks the target is rest."""
        guidance, axes, manoeuvre = self._guidance, self._guidance.axes, self._guidance.manoeuvre
        t = guidance.t
        free = self._obeys_sticks
        if manoeuvre.following is not None and manoeuvre.following.ends(t):
            guidance.end_manoeuvre()
            self.outbox.say("info", "off the path" if self.stopping else "the end of the path")
        elif manoeuvre.busy and command is not None and free and not centred(command):
            guidance.end_manoeuvre()
        manoeuvre.set_off(t)
        moves = command is not None and free and not (manoeuvre.busy and centred(command))
        if not self.stopping:  # a stop has limits of its own
            stick = command if command is not None and moves else AT_REST
            guidance.aim(stick)
        axes.turn_camera(command.tilt if command is not None and free else 0.0, t)

    # Requests.

    def answer(self, request: PilotRequest, command: PilotCommand | None, now: Ns) -> PilotAnswer:
        """Grant or refuse a request."""
        reason = self.authority.refusal(request, now) or refusal(
            request,
            command,
            armed=self.armed,
            ready=self._running and events.STATE_LOST.name not in self._failsafes.holding,
            board=events.BOARD_SILENT.name not in self._failsafes.holding,
            stopping=self.stopping,
            acting=self._failsafes.acting is not None,
        )
        takes = request.kind in ("lease", "force")
        if takes or request.kind in ("offer", "release"):
            self._pass_control(request, reason, now)
        else:
            reason = reason or self._do(request, now)
        return PilotAnswer(
            stamp_ns=now,
            id=request.id,
            accepted=not reason,
            reason=reason,
            note=(not reason and self._note(request)) or UNSET,
            stop=self._stop if request.kind == "stop" else None,
            epoch=self.authority.lease.epoch if takes and not reason else None,
            cause_ns=request.stamp_ns,
        )

    def _note(self, request: PilotRequest) -> str:
        """What the pilot should know of a request that is granted."""
        if request.kind == "mode" and self._mode_at_rest is not None:
            return "the drone is stopping; it changes when it is at rest"
        return requests.onto_the_bottom(self._guidance, request.depth)

    def _pass_control(self, request: PilotRequest, reason: str, now: Ns) -> None:
        if not reason and (announcement := self.authority.grant(request, now)):
            self.outbox.say("info", announcement)

    def handed_on(self, request: PilotRequest, now: Ns) -> bool:
        """Do what control has already done and answered, while this service was silent. Returns
        whether anything changes: a disarm does not end a later arming."""
        ends = request.kind == "disarm" and request.stamp_ns >= self._armed_ns
        if not self.armed or not (ends or request.kind == "stop"):
            return False
        self._do(request, now)
        return True

    def _do(self, request: PilotRequest, now: Ns) -> str:
        """Execute a request. Returns the reason for a refusal, or nothing."""
        guidance = self._guidance
        match request.kind:
            case "arm":
                self._arm()
                asked_ns = min(request.stamp_ns, now)
                self._armed_ns = max(asked_ns, self._armed_ns, self._disarmed_ns + 1)
            case "disarm":
                self._disarmed_ns = max(self._disarmed_ns, min(request.stamp_ns, now))
                self.armed = self.stopping = False
                self._mode_at_rest = None
                self._failsafes.disarm()
                self.outputs.disarm()
                guidance.change(self.requested)
            case "resume":
                return self._failsafes.resume()
            case "stop":
                self.stopping, self._stop = True, guidance.stop()
                self._mode_at_rest = None
            case "light" | "output":
                return self.outputs.set(request, now, armed=self.armed)
            case "goto" | "follow" | "home" | "unwind" | "mode":
                return self._move(request)
            case "lease" | "offer" | "release" | "force":
                pass  # `_pass_control`
        return ""

    def _move(self, request: PilotRequest) -> str:
        """Begin a manoeuvre or change the mode. Returns the reason for a refusal, or nothing."""
        guidance = self._guidance
        match request.kind:
            case "goto":
                return requests.goto(guidance, request)
            case "follow":
                return requests.follow(guidance, request.course)
            case "home":
                return requests.home(guidance)
            case "unwind":
                return requests.unwind(guidance)
            case _:
                pass
        if self.armed and self.stopping and request.flight_mode is not None:
            self._mode_at_rest = request.flight_mode
            return ""
        reason = requests.mode(guidance, request.flight_mode, armed=self.armed)
        self.requested = self.requested if reason else guidance.flight_mode
        return reason

    def _end_stop(self) -> None:
        """The sticks are centred: where the drone rests, too, a stop is over, and the mode that was
        asked for in it is taken up, unless a failsafe acts."""
        self.stopping = self.stopping and not self._guidance.settled
        wanted = self._mode_at_rest
        if self.stopping or wanted is None:
            return
        self._mode_at_rest = None
        reason = "a failsafe acts" if self._acts else ""
        reason = reason or requests.mode(self._guidance, wanted, armed=self.armed)
        if reason:
            self.outbox.tell(events.REFUSED("mode", detail=reason))
        else:
            self.requested = self._guidance.flight_mode

    def _arm(self) -> None:
        """Arm in the requested mode, if it is available; otherwise stabilised."""
        if self.armed:
            return
        guidance, self.armed = self._guidance, True
        if guidance.home.lost:
            guidance.home = Home()
        known = guidance.bottom.known
        if reason := lacking(self.requested, guidance.state, armed=True, bottom=known):
            self.outbox.tell(events.REFUSED(self.requested, detail=f"armed without it: {reason}"))
        guidance.flight_mode = "stabilised" if reason else self.requested

    # Status.

    def summary(self, now: Ns) -> tuple[object, ...]:
        """A change of this publishes a status at once."""
        fs = self._failsafes
        said = fs.acting, fs.reaction, fs.resumable, fs.returns, fs.holding
        holder = self.authority.holder(now)
        lit = (*self.outputs.values.values(),)
        return self.activity, self.armed, self._guidance.flight_mode, holder, lit, *said

    def status(self, now: Ns) -> VehicleStatus:
        failsafes = self._failsafes
        row = failsafes.acting
        where = whereabouts(None if self._silent else self._guidance.state)
        held_back = self.armed and self._guidance.held_back
        clamped = events.CLAMPED_HORIZONTAL.sentence if held_back else ""
        return VehicleStatus(
            stamp_ns=now,
            activity=self.activity,
            armed=self.armed,
            flight_mode=self._guidance.flight_mode,
            failsafe="none" if row is None else cast(Failsafe, row.name),
            reaction=failsafes.reaction,
            since_ns=failsafes.since_ns,
            next_ns=failsafes.next_ns,
            resumable=failsafes.resumable,
            returns=failsafes.returns,
            words=failsafes.words,
            conditions=failsafes.holding,
            pilot=self.authority.holder(now),
            epoch=self.authority.lease.epoch,
            light=self.outputs.light,
            note="; ".join(filter(None, (self._not_ready, failsafes.notices, clamped))),
            stop=self._stop if self.stopping else None,
            depth=where.depth,
            heading=where.heading,
            depth_moved=self._guidance.standstill.moved or UNSET,
            outputs=self.outputs.all,
            altitude=self._guidance.altitude,
            altitude_wanted=_known(self._guidance.height.wanted),
            goal=_known(self._guidance.manoeuvre.goal),
            waypoints=self._ahead or UNSET,
        )

    @property
    def _ahead(self) -> tuple[PlaceAhead, ...]:
        """The next way-points of the path that is followed."""
        found = self._guidance.manoeuvre.waypoints(self._guidance.t)
        return tuple(PlaceAhead(north, east) for north, east in found)

    @property
    def _not_ready(self) -> str:
        """For the pilot: why the drone is not ready."""
        if self._running:
            return ""
        if self._silent:
            return (
                "not ready: no state of the drone: no usable samples of its IMU, or estimation "
                "does not run"
            )
        state = self._guidance.state
        if state is not None and state.blocked_by:
            return f"not ready: {sentence(state.blocked_by)}; see the warning of estimation"
        left = None if state is None else state.calibration_left
        text = "calibrating: keep the drone still"
        return text if left is None else f"{text}, {left:.0f} s to go"

    @property
    def activity(self) -> Activity:
        if not self.armed:
            return "ready" if self._running else "starting"
        if self.stopping:
            return "stopping"
        manoeuvre = self._guidance.manoeuvre
        if manoeuvre.on_a_path and manoeuvre.goal is None:
            return "follow"
        return "goto" if manoeuvre.busy else "piloted"
