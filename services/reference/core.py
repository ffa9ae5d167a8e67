"""From pilot commands to the reference.

The mode (`modes.py`) says which axes the drone holds. The sticks of held axes are velocities; the
position reference is their exact integral. The sticks of the other axes are forces, ramped by the
same jerk-bounded law. The pilot can request positions and paths; a deflected stick overrides them
at any moment. What the drone does by itself when something fails is the failsafe table
(`failsafe/`): come to rest smoothly and hold, rise, stay at the surface.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import cast

import msgspec
from msgspec import UNSET

from messages import events
from messages.events import Outbox
from messages.message import Notice
from messages.pilot import (
    MANOEUVRES,
    FlightMode,
    PilotAnswer,
    PilotCommand,
    PilotRequest,
    StopDistance,
)
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.units import Ns, Outputs
from messages.vehicle import Activity, Failsafe, PlaceAhead, VehicleStatus
from services.marine.outputs import OUTPUTS, Output
from services.marine.rhythm import SensorTime
from services.reference.failsafe.machine import FailsafeMachine, Memory
from services.reference.failsafe.table import ConditionWatch, table
from services.reference.guidance import requests
from services.reference.guidance.authority import ControlAuthority, Lease
from services.reference.guidance.axes import CentredSticks, centred, lacking, motion_of
from services.reference.guidance.guidance import Guidance
from services.reference.guidance.requests import PilotOutputs
from services.reference.guidance.station_keeping import Home, HomePlace, whereabouts
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


INITIAL = GuidanceCheckpoint()


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
        newest, lease = self.conditions.newest, self.authority.lease
        self._silent = state is None
        if state is not None:
            self._running = state.phase == "running"
        at = self._time.step(None if state is None else state.sensor_ns, now)
        guidance.see(state, at / 1e9, armed=self.armed)
        guidance.bottom.see(newest.dvl, state, guidance.t, newest.altimeter)
        if guidance.state is None:
            self.outputs.step(command, now, armed=self.armed, free=False)
            return None

        # What the failsafe table says; a condition that begins to act ends the manoeuvre.
        seen = self.conditions
        seen.state, seen.command, seen.now, seen.armed = state, command, now, self.armed
        seen.unheld = guidance.unheld if self.armed else ()
        seen.limited = self.armed and guidance.axes.limited
        seen.above_floor = self.armed and guidance.near_floor
        failsafes.step(
            seen.holding(),
            now,
            armed=self.armed,
            at_surface=self._initialised and guidance.has_risen(s.surface_depth),
            unknown=seen.unknown,
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
            if self.requested == "altitude_hold":
                self.requested = guidance.flight_mode
        else:
            guidance.rest()
            self._initialised = True
        free = self.armed and not (self._acts or self.stopping)  # it obeys the sticks
        self._aim(command if free else None)
        self.outputs.step(command, now, armed=self.armed, free=free)
        if state is not None and self.armed:
            guidance.wait(state, newest.wrench)
        return self._reference(state, command, now)

    def _reference(
        self, state: VehicleState | None, command: PilotCommand | None, now: Ns
    ) -> Reference:
        """All axes at this instant, with the stamps of the state and pilot command behind them."""
        axes, t, held = self._guidance.axes, self._guidance.t, self._guidance.held
        pace, place = motion_of(axes.pace, t), axes.place.now if axes.place.held else None
        surge_force, sway_force = axes.force.at(t)
        return Reference(
            stamp_ns=now,
            sensor_ns=None if state is None else state.sensor_ns,
            pilot_ns=None if command is None else command.stamp_ns,
            epoch=self.authority.lease.acting,
            armed=self.armed,
            armed_ns=self._armed_ns if self.armed else None,
            depth=motion_of(axes.heave, t, held=held.depth),
            heading=motion_of(axes.yaw, t, held=held.heading),
            surge_force=surge_force.velocity,
            sway_force=sway_force.velocity,
            heave_force=None if held.depth else axes.heave_force.at(t).velocity,
            yaw_moment=None if held.heading else axes.yaw_moment.at(t).velocity,
            surge=pace if place is None and (axes.pace.rides or pace.velocity != 0.0) else None,
            north=None if place is None else Motion(*place[0]),
            east=None if place is None else Motion(*place[1]),
            tilt=motion_of(axes.tilt, t),
            gripper=self.outputs.gripper,
        )

    def _aim(self, command: PilotCommand | None) -> None:
        """Set the axes' targets from the sticks; without sticks the target is rest."""
        guidance = self._guidance
        moves = command is not None and not centred(command)
        if guidance.following is not None and guidance.following.ends(guidance.t):
            guidance.end_manoeuvre()
            self.outbox.say("info", "off the path" if self.stopping else "the end of the path")
        elif guidance.busy and moves:
            guidance.end_manoeuvre()
        guidance.set_off()
        if not self.stopping:  # a stop has limits of its own
            sticks = None if guidance.busy and not moves else command
            guidance.aim(sticks or AT_REST)
        guidance.axes.turn_camera(0.0 if command is None else command.tilt, guidance.t)

    # Requests.

    def answer(self, request: PilotRequest, command: PilotCommand | None, now: Ns) -> PilotAnswer:
        """Grant or refuse a request."""
        reason = self.authority.refusal(request, now) or self._refusal(request, command)
        reason = reason or self._do(request, now)
        takes = request.kind in ("lease", "force") and not reason
        return PilotAnswer(
            stamp_ns=now,
            id=request.id,
            accepted=not reason,
            reason=reason,
            note=(not reason and self._note(request)) or UNSET,
            stop=self._stop if request.kind == "stop" else None,
            epoch=self.authority.lease.epoch if takes else None,
            cause_ns=request.stamp_ns,
        )

    def _refusal(self, request: PilotRequest, command: PilotCommand | None) -> str:
        """Why a request cannot be granted now; empty when it can."""
        moves, holding = request.kind in MANOEUVRES, self._failsafes.holding
        if request.kind == "arm" and events.BOARD_SILENT.name in holding:
            return events.BOARD_SILENT.sentence
        if request.kind == "arm" and not self.armed:
            if not self._running or events.STATE_LOST.name in holding:
                return "the drone does not know its depth and attitude yet"
            if command is None or command.pilot == "lost":
                return "no pilot: no fresh stick positions arrive"
            if not centred(command):
                return "the sticks are not centred"
        if moves and not self.armed:
            return "the drone is not armed"
        if (moves or request.kind == "mode") and self.armed and self._failsafes.acting is not None:
            return "a failsafe acts; first resume"
        if moves and self.stopping:
            return "the drone is stopping; ask again when it is at rest"
        if moves and command is not None and not centred(command):
            return "the sticks are not centred, and they have priority"
        return ""

    def _note(self, request: PilotRequest) -> str:
        """What the pilot should know of a request that is granted."""
        if request.kind == "mode" and self._mode_at_rest is not None:
            return "the drone is stopping; it changes when it is at rest"
        return requests.onto_the_bottom(self._guidance, request.depth)

    def handed_on(self, request: PilotRequest, now: Ns) -> bool:
        """Do what control has already done and answered, while this service was silent. Returns
        whether anything changes: a disarm does not end a later arming."""
        ends = request.kind == "disarm" and request.stamp_ns >= self._armed_ns
        if not self.armed or not (ends or request.kind == "stop"):
            return False
        self._do(request, now)
        return True

    def _do(self, request: PilotRequest, now: Ns) -> str:  # noqa: C901 - one kind after the other
        """Execute a request. Returns the reason for a refusal, or nothing."""
        guidance, asked_ns = self._guidance, min(request.stamp_ns, now)
        match request.kind:
            case "arm":
                self._arm()
                self._armed_ns = max(asked_ns, self._armed_ns, self._disarmed_ns + 1)
            case "disarm":
                self._disarmed_ns = max(self._disarmed_ns, asked_ns)
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
            case "mode" if self.armed and self.stopping and request.flight_mode is not None:
                self._mode_at_rest = request.flight_mode
            case "mode":
                return self._change(request.flight_mode)
            case "goto" | "follow" | "home" | "unwind":
                return requests.manoeuvre(guidance, request)
            case "lease" | "offer" | "release" | "force":
                if announcement := self.authority.grant(request, now):
                    self.outbox.say("info", announcement)
        return ""

    def _change(self, flight_mode: FlightMode | None) -> str:
        """Change the mode, as the pilot has asked."""
        reason = requests.mode(self._guidance, flight_mode, armed=self.armed)
        self.requested = self.requested if reason else self._guidance.flight_mode
        return reason

    def _end_stop(self) -> None:
        """The sticks are centred: where the drone rests, too, a stop is over, and the mode that was
        asked for in it is taken up, unless a failsafe acts."""
        self.stopping = self.stopping and not self._guidance.settled
        wanted = self._mode_at_rest
        if self.stopping or wanted is None:
            return
        self._mode_at_rest = None
        if reason := "a failsafe acts" if self._acts else self._change(wanted):
            self.outbox.tell(events.REFUSED("mode", detail=reason))

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
        failsafes, guidance = self._failsafes, self._guidance
        acting, height, goal = failsafes.acting, guidance.height.wanted, guidance.goal
        depth, heading = whereabouts(None if self._silent else guidance.state)
        held_back = self.armed and guidance.held_back
        clamped = (Notice(events.CLAMPED_HORIZONTAL.name),) if held_back else ()
        return VehicleStatus(
            stamp_ns=now,
            activity=self.activity,
            armed=self.armed,
            flight_mode=guidance.flight_mode,
            failsafe="none" if acting is None else cast(Failsafe, acting.name),
            reaction=failsafes.reaction,
            since_ns=failsafes.since_ns,
            next_ns=failsafes.next_ns,
            resumable=failsafes.resumable,
            returns=failsafes.returns,
            acting=failsafes.acts,
            conditions=failsafes.holding,
            pilot=self.authority.holder(now),
            epoch=self.authority.lease.epoch,
            light=self.outputs.light,
            notices=(*self._not_ready, *failsafes.notices, *clamped),
            stop=self._stop if self.stopping else None,
            depth=depth,
            heading=heading,
            depth_moved=guidance.standstill.moved or UNSET,
            outputs=self.outputs.all,
            altitude=guidance.altitude,
            altitude_wanted=UNSET if height is None else height,
            goal=UNSET if goal is None else goal,
            waypoints=tuple(PlaceAhead(*place) for place in guidance.waypoints) or UNSET,
        )

    @property
    def _not_ready(self) -> tuple[Notice, ...]:
        """For the pilot: why the drone is not ready; empty: it is."""
        if self._running:
            return ()
        if self._silent:
            return (Notice("no_state"),)
        state = self._guidance.state
        if state is not None and state.blocked_by:
            return (Notice("not_ready", about=(state.blocked_by,)),)
        left = None if state is None else state.calibration_left
        return (Notice("calibrating", {} if left is None else {"wait_s": round(left)}),)

    @property
    def activity(self) -> Activity:
        guidance = self._guidance
        if not self.armed:
            return "ready" if self._running else "starting"
        if self.stopping:
            return "stopping"
        if guidance.on_a_path and guidance.goal is None:
            return "follow"
        return "goto" if guidance.busy else "piloted"
