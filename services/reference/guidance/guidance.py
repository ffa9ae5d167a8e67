"""Guidance: which generator moves each axis, by the mode, the manoeuvre and the vehicle itself.

A mode change needs no special handling: the reference of an axis that is not held follows the
vehicle, and holding the axis stops that. A force reference begins at zero when its axis is released
and ends when the axis is held; control makes the hand-over bumpless. A manoeuvre goes to a depth, a
heading or both, or along a path; depth and heading must be held meanwhile, and at its end the axes
continue without a step.
"""

from dataclasses import dataclass, field
from math import dist, inf

from msgspec import UNSET, UnsetType

from messages import events
from messages.control import Wrench
from messages.events import Outbox
from messages.message import Estimate
from messages.pilot import Course, FlightMode, PilotCommand, StopDistance
from messages.state import VehicleState
from services.marine.attitude import north_offset
from services.reference.guidance.axes import HELD_AXES, Axes, HeldAxes, safe
from services.reference.guidance.bottom import Bottom, HeightHold
from services.reference.guidance.guards import (
    EstimateWatch,
    ReferenceGovernor,
    Standstill,
    TiltLimit,
    is_released,
    tilt_of,
)
from services.reference.guidance.path_following import PathFollowing, PlannedPath
from services.reference.guidance.station_keeping import GroundMotion, Home, Pair, ground_of
from services.reference.settings import Settings
from services.reference.trajectory.minimum_jerk import Ramp, Sample, go
from services.reference.trajectory.own_law import Law

RISEN = 0.01  # [m] an ascent that ends this close to its depth has reached it
TURN_SHORT = 0.04  # [rad] largest error of a heading for which there is not enough thrust
SHORT_OF_YAW = 0.01  # [-] of the yaw moment that is wanted; a smaller lack is rounding
PLACE_PATIENCE_S = 2.0  # [s] without a position measurement before station keeping ends
AIMED = 0.01  # [rad] a path begins when the heading error is at most this
AT_DEPTH = 1e-6  # [m] and when the depth reference is this close to the path's depth
AT_GOAL = 0.05  # [m] a goal this close counts as reached


@dataclass(slots=True)
class Guidance:
    """Times `t` in seconds, never decreasing."""

    settings: Settings
    outbox: Outbox
    flight_mode: FlightMode = "stabilised"
    law: Law | None = None  # of the user's
    axes: Axes = field(init=False)
    state: VehicleState | None = None  # newest received
    ground: GroundMotion | None = None  # None: not measured now
    t: float = 0.0  # [s] of the newest reference
    # The manoeuvre.
    going: bool = False  # to a depth, a heading or both
    planned: PlannedPath | None = None  # a path to follow, once the drone points along it
    following: PathFollowing | None = None
    measured: bool = False  # position along the path is measured, not dead-reckoned
    goal: Pair | None = None  # [m] north, east, at the end of a straight line
    # What it does by itself.
    held_back: bool = False  # surge and sway, because the vehicle tilts
    near_floor: bool = False  # the stick points down, and leads no nearer to the bottom
    bottom: Bottom = field(default_factory=Bottom)
    height: HeightHold = field(init=False)
    home: Home = field(default_factory=Home)
    standstill: Standstill = field(init=False)  # of heave, [m]
    _stepped: float = 0.0  # [s] of the reference before
    _place_seen: float = 0.0  # [s] when the position was last measured, or not needed
    _rising: bool = False  # an ascent has begun, or has ended at its depth
    _moved: float | None = None  # [m] jumps of the pressure that the depth has been moved with
    _estimates: dict[str, EstimateWatch] = field(init=False)
    _governors: dict[str, ReferenceGovernor] = field(init=False)
    _tilt_limit: TiltLimit = field(default_factory=TiltLimit)

    def __post_init__(self) -> None:
        s = self.settings
        self.axes = Axes(s, self.outbox, self.law)
        self.standstill = Standstill(s.standstill)
        self.height = HeightHold(s.heave.max_velocity, s.failsafe.floor_distance)
        self._estimates = {"depth": EstimateWatch(), "heading": EstimateWatch()}
        most = {"depth": s.heave, "heading": s.yaw, "place": s.place}
        self._governors = {name: ReferenceGovernor(a.max_error) for name, a in most.items()}

    @property
    def held(self) -> HeldAxes:
        return HELD_AXES[self.flight_mode]

    @property
    def on_a_path(self) -> bool:
        return self.planned is not None or self.following is not None

    @property
    def busy(self) -> bool:
        return self.going or self.on_a_path

    @property
    def settled(self) -> bool:
        """At rest, and not following a path."""
        return self.following is None and self.axes.settles() <= self.t

    @property
    def waypoints(self) -> tuple[Pair, ...]:
        """[m] North, east of the next ones of a path; none of a line to a goal."""
        following = self.following
        return () if following is None or self.goal is not None else following.ahead(self.t)

    @property
    def altitude(self) -> float | UnsetType:
        """[m] Above the bottom now; absent: not measured."""
        if self.state is None or not (self.bottom.known and self.state.depth.valid):
            return UNSET
        return self.bottom.depth(self.t) - self.state.depth.value

    @property
    def unheld(self) -> tuple[str, ...]:
        """Axes that the mode holds, but whose estimates are not valid."""
        held = {"depth": self.held.depth, "heading": self.held.heading}
        return tuple(name for name, watch in self._estimates.items() if held[name] and watch.lost)

    # Steps, in the order of a step.

    def see(self, state: VehicleState | None, t: float, *, armed: bool) -> None:
        """Take in a new instant `t` [s] with its state, if any. Where the pressure has jumped, the
        vehicle has not moved: neither must it now."""
        self._stepped, self.t = self.t, max(self.t, t)
        self.ground = None if state is None else ground_of(state)
        self.state = state or self.state
        self._tilt_limit.step(None if state is None else tilt_of(state), self.t - self._stepped)
        if state is None:
            return
        was_lost = self.home.lost
        self.home.see(state, self.ground, self.t, armed=armed)
        if self.home.lost and not was_lost:
            self.outbox.say("warning", self.home.missing)
        moved = state.depth_moved or 0.0
        before, self._moved = self._moved, moved
        if before is not None and moved != 0.0 and moved != before:
            if not self.axes.heave.rides:
                self.axes.heave.shift(moved - before)
            self.bottom.shift(moved - before)
            by = f"{moved - before:+.2f} m"
            self.outbox.say("info", f"the depth is held {by} from before, as measured")

    def rest(self) -> None:
        """Set every axis to the vehicle's position, at rest."""
        assert self.state is not None
        self.axes.rest(self.state.depth.value, self.state.heading.value, self.t)
        self._rising = False
        self._place_seen = self.t
        self.height.forget()

    def move_on(self, state: VehicleState | None) -> None:
        """Advance held axes; the others follow the vehicle if there is a state."""
        axes, t = self.axes, self.t
        if state is not None:
            axes.follow(state, self.held, t)
        self._keep_place(state)
        # Without an altitude the depth is held, until the pilot asks for the height again.
        if self.held.height and self.bottom.lost:
            self.outbox.tell(events.LOST_ALTITUDE())
            self.flight_mode = "stabilised"
        # Depth or heading is no longer known; once it is known again, the vehicle is held where it
        # is then. Without a state, there is a failsafe already.
        if state is None:
            return
        s, held = state, self.held
        for name, ramp, here, rate, holds in (
            ("depth", axes.heave, s.depth, s.depth_rate, held.depth),
            ("heading", axes.yaw, s.heading, s.yaw_rate, held.heading),
        ):
            change = self._estimates[name].see(valid=here.valid and rate.valid, t=t)
            if change == "lost" and holds:
                self.outbox.tell(events.UNHELD(name))
            elif change == "back" and holds:
                acceleration = ramp.at(t).acceleration  # so that the force makes no step
                if not ramp.rides:
                    ramp.take(Sample(here.value, rate.value, acceleration, 0.0), t)
                self.outbox.say("info", f"the {name} is known again, and held from here on")

    def _keep_place(self, state: VehicleState | None) -> None:
        """Station keeping begins, goes on, or ends; when the position is not measured for a while,
        a path goes on by dead reckoning."""
        place, t, following = self.axes.place, self.t, self.following
        needed = self.held.place or (self.on_a_path and self.measured)
        if self.ground is not None or state is None or not needed:
            self._place_seen = t
        elif t - self._place_seen > PLACE_PATIENCE_S:
            self.outbox.tell(events.LOST_PLACE())
            self.measured = False
            if following is not None:
                following.shift = None
                self._follow(following)
            elif self.goal is not None:
                self._forget()
            self.flight_mode = "stabilised" if self.held.place else self.flight_mode
        if following is not None:
            wanted = following.shift is not None
        else:
            wanted = self.held.place or (self.planned is not None and self.measured)
        if not wanted:
            place.held = False
        elif place.held:
            turns = None if following is not None or state is None else north_offset(state)
            place.step(self.axes.yaw.at(t), place.offset if turns is None else turns, t)
        elif self.ground is not None:
            place.take_measured(self.ground, t)
            self.axes.pace.rest(0.0, t)  # its speed is part of the measured motion

    def set_off(self) -> None:
        """Begin a planned path once heading, depth and position are settled."""
        planned, axes, t = self.planned, self.axes, self.t
        if planned is None:
            self.going = self.going and axes.settles() > t
            return
        if axes.settles() > t or (self.measured and not axes.place.held):
            return
        place, offset = None, 0.0
        if self.measured:
            north, east = axes.place.now
            place, offset = (north.position, east.position), axes.place.offset
        if self.goal is not None and place is not None:
            if dist(place, self.goal) < AT_GOAL:
                self._forget()
                return
            planned = self.planned = PlannedPath(Course(waypoints=(place, self.goal)))
        # The governor may have moved the reference, or the drone may rest elsewhere.
        heading, depth = axes.yaw.at(t).position, planned.first_depth
        away = 0.0 if depth is None else abs(depth - axes.heave.at(t).position)
        if away > AT_DEPTH or abs(planned.first_heading(heading, offset) - heading) > AIMED:
            self._line_up(planned, offset)
            return
        self.planned = None
        self._follow(planned.begin(heading, place, t))

    def aim(self, stick: PilotCommand) -> None:
        """Set the axes' targets from the sticks. Where the depth is held, a vehicle that tilts too
        far gets a share of surge and sway."""
        share = self._tilt_limit.share if self.held.depth else 1.0
        before, moves = self.held_back, stick.surge != 0.0 or stick.sway != 0.0
        self.held_back = share < 1.0 and (moves or before)
        if self.held_back and not before:
            self.outbox.tell(events.CLAMPED_HORIZONTAL())
        self.axes.aim(stick, self.held, self.t, share, self._sink(stick.heave))

    def _sink(self, stick: float) -> float:
        """[m/s] The velocity of the depth: the stick's, or one that holds a height, or that ends
        above the bottom."""
        heave, asked = self.axes.heave, stick * self.settings.heave.max_velocity
        above = heave.at(self.t), heave.limits, self.bottom, self.t
        was_near, self.near_floor = self.near_floor, False
        if not self.bottom.known:
            # A stick that led no nearer leads nowhere until it was let go of: nobody knows any more
            # what it would lead to.
            self.height.forget()
            self.near_floor = was_near and asked > 0.0 and self.held.depth
            return 0.0 if self.near_floor else asked
        if self.held.height:
            sink = self.height.velocity(asked, *above)
        else:
            self.height.forget()
            if asked <= 0.0 or not self.held.depth or self.height.floor == 0.0:
                return asked
            sink = self.height.sinking(asked, *above)
        self.near_floor = asked > 0.0 and sink < asked
        return sink

    def wait(self, state: VehicleState, wrench: Wrench | None = None) -> None:
        """Keep the reference close to a vehicle that cannot follow it: sooner where the thrusters
        are at a limit and give less yaw than control asks for."""
        axes, held, t = self.axes, self.held, self.t
        if self.following is not None:
            self.following.watch(state, self.ground, t)
            return
        if held.depth:
            deepest = self.settings.failsafe.depth_limit
            self._end_stop(state, deepest)
            self._keep("depth", axes.heave, state.depth, deepest)
        if held.heading:
            most = self.settings.yaw.max_error
            if wrench is not None and wrench.saturated:
                wanted, achieved = wrench.wanted[5], wrench.achieved[5]
                if abs(wanted - achieved) > SHORT_OF_YAW * abs(wanted):
                    most = min(most, TURN_SHORT)
            self._governors["heading"].most = most
            self._keep("heading", axes.yaw, state.heading)
        if axes.place.held and self.ground is not None:
            (north, east), size = axes.place.error(self.ground)
            by = self._share("place", size, *axes.place.now) - 1.0
            if by != 0.0:
                axes.place.shift(north * by, east * by)

    def _end_stop(self, state: VehicleState, deepest: float) -> None:
        """Hold the depth to which a stop of the stick has brought the vehicle, not below `deepest`
        [m]. Where the reference ends at a depth that was asked for, or waits for the vehicle, it
        stays; and without the accelerometer, with which a standstill is known too late."""
        heave, depth, rate = self.axes.heave, state.depth, state.depth_rate
        asked_for = self.busy or self._rising or self.axes.limited or self.near_floor
        known = depth.valid and rate.valid and state.depth_acceleration.valid
        if asked_for or self._governors["depth"].blocked or not known:
            self.standstill.cancel()
            return
        here = heave.at(self.t)
        error = min(depth.value - here.position, max(0.0, deepest - here.position))
        resting = here.velocity == 0.0 == here.acceleration and heave.settles() <= self.t
        corrected = None if state.depth_corrected is UNSET else state.depth_corrected
        by = self.standstill.step(
            error, rate.value, self.t, resting=resting, velocity=here.velocity, corrected=corrected
        )
        if by != 0.0:
            heave.shift(min(by, max(0.0, deepest - here.position)))

    def _keep(self, name: str, ramp: Ramp, estimate: Estimate, deepest: float = inf) -> None:
        """`deepest`: the reference is not moved beyond this position."""
        if estimate.valid:
            here = ramp.at(self.t)
            error = here.position - estimate.value
            by = self._share(name, abs(error), here) - 1.0
            if by != 0.0:
                ramp.shift(min(error * by, max(0.0, deepest - here.position)))

    def _share(self, name: str, size: float, *motions: Sample) -> float:
        """The share of an error of this size that remains of a reference with these motions."""
        governor = self._governors[name]
        before = governor.blocked
        released = before and is_released(*motions)
        share = governor.keep(size, self.t - self._stepped, released=released)
        if governor.blocked and not before:
            self.outbox.tell(events.CLAMPED(f"reference.{name}"))
        return share

    # What swaps the generators.

    def go(self, depth: float | None, heading: float | None) -> None:
        """Go to a depth [m] and a control heading [rad], accumulated."""
        axes, yaw = self.axes, self.settings.yaw
        if depth is not None:
            axes.go_to_depth(depth, self.t)
        if heading is not None:
            go(axes.yaw, heading, yaw.limits, yaw.max_velocity, self.t)
        self.going = True

    def plan(
        self, planned: PlannedPath, *, measured: bool, offset: float, goal: Pair | None = None
    ) -> None:
        """Turn to the path's first heading and depth, then follow it.

        Args:
            measured: hold the position until the path begins, and begin it there.
            offset: [rad] north heading minus control heading.
            goal: [m] the path is a line to here from wherever the drone comes to rest.
        """
        self.planned, self.measured, self.goal = planned, measured, goal
        self._line_up(planned, offset if measured else 0.0)

    def _line_up(self, planned: PlannedPath, offset: float) -> None:
        """Go to the path's first heading and depth."""
        here = self.axes.yaw.at(self.t).position
        self.go(planned.first_depth, planned.first_heading(here, offset))
        self.going = False

    def _follow(self, following: PathFollowing) -> None:
        """From now on, the path moves what it knows."""
        axes, self.following = self.axes, following
        axes.yaw.ride(following.heading)
        if following.has_depth:
            axes.heave.ride(following.depth)
        if following.shift is None:
            axes.pace.ride(following.along)
            axes.place.held = False
        else:
            axes.place.ride(following.place, self.t)

    def end_manoeuvre(self, *, hold_place: bool | None = None) -> None:
        """Come to rest on all axes, without a step. A measured path ends in station keeping where
        the mode, or `hold_place`, says so; otherwise the speed is ramped out along the heading."""
        axes, t, following = self.axes, self.t, self.following
        if self.going or self.planned is not None:
            axes.brake(t)
        self._forget()
        if following is None:
            return
        axes.yaw.brake(t)
        if following.has_depth:
            axes.heave.brake(t)
        if (self.held.place if hold_place is None else hold_place) and following.shift is not None:
            axes.place.take(*axes.place.now, t)
        else:
            axes.place.held = False
            axes.pace.take(following.along(t)._replace(position=0.0), t)

    def _forget(self) -> None:
        self.going, self.planned, self.following, self.goal = False, None, None, None

    def change(self, flight_mode: FlightMode) -> None:
        """Change the mode; ends the manoeuvre."""
        self.end_manoeuvre(hold_place=HELD_AXES[flight_mode].place)
        self.flight_mode = flight_mode

    def come_to_rest(self) -> None:
        """Failsafe: come to rest smoothly, on a path along it, and hold."""
        self.flight_mode, following = safe(self.flight_mode), self.following
        if following is None and self.busy:
            self.axes.brake(self.t)
        self._forget()
        if following is not None:
            self._follow(following.stop(self.settings.place.limits, self.t)[0])

    def rise(self, depth: float, speed: float) -> None:
        """Failsafe: rise to a depth [m] at a speed [m/s], unless above it. Called at each step."""
        heave, t = self.axes.heave, self.t
        if self.following is not None:  # it comes to rest on its path first
            return
        end = heave.at(t).position + heave.to_go(t)
        if end > depth + RISEN and (not self._rising or heave.settles() <= t):
            self.axes.go_to_depth(depth, t, speed)
        self._rising = True

    def has_risen(self, depth: float) -> bool:
        """At rest at a depth [m], or above it."""
        heave = self.axes.heave
        return heave.settles() <= self.t and heave.at(self.t).position <= depth + RISEN

    def end_rise(self) -> None:
        """Come to rest, and hold."""
        if self._rising:
            self._rising = False
            self.axes.brake(self.t)

    def stop(self) -> StopDistance:
        """Emergency stop, along the path if there is one. Returns the stopping distance."""
        axes, t, following = self.axes, self.t, self.following
        self.flight_mode, self.near_floor = safe(self.flight_mode), False
        axes.force.aim((0.0, 0.0), t, self.settings.horizontal.stop)
        self._forget()
        if following is not None:
            here = following.point(t)
            stopping, end = following.stop(self.settings.place.stop, t)
            self._follow(stopping)
            there = stopping.point(end)
            ground = dist((here.north, here.east), (there.north, there.east))
            return StopDistance(
                there.down - here.down,
                there.heading - here.heading,
                end - t,
                ground if self.measured else UNSET,
            )
        axes.brake(t, hard=True)
        return StopDistance(
            axes.heave.to_go(t),
            axes.yaw.to_go(t),
            axes.settles() - t,
            axes.place.to_go(axes.yaw.at) if axes.place.held else UNSET,
        )
