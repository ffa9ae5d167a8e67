"""Guidance: the held axes, their reference, and the current manoeuvre.

A mode change needs no special handling: the reference of an axis that is not held follows the
vehicle, and holding the axis stops that. A force reference begins at zero when its axis is released
and ends when the axis is held; control makes the hand-over bumpless.
"""

from dataclasses import dataclass, field
from math import inf

from msgspec import UNSET, UnsetType

from messages import events
from messages.events import Outbox
from messages.message import Estimate
from messages.pilot import FlightMode, PilotCommand, StopDistance
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.units import Ns
from services.marine.attitude import north_offset
from services.reference.guidance.axes import Axes
from services.reference.guidance.bottom import Bottom, HeightHold
from services.reference.guidance.ground_motion import GroundMotion, Home, ground_of
from services.reference.guidance.guards import (
    EstimateWatch,
    ReferenceGovernor,
    Standstill,
    TiltLimit,
    is_released,
    tilt_of,
)
from services.reference.guidance.manoeuvre import Manoeuvre
from services.reference.guidance.modes import HELD_AXES, HeldAxes, safe
from services.reference.settings import Settings
from services.reference.trajectory.minimum_jerk import Ramp, Sample
from services.reference.trajectory.own_law import Law

RISEN = 0.01  # [m] an ascent that ends this close to its depth has reached it
TURN_SHORT = 0.04  # [rad] largest error of a heading for which there is not enough thrust
PLACE_PATIENCE_S = 2.0  # [s] without a position measurement before station keeping ends


@dataclass(slots=True)
class Guidance:
    """Times `t` in seconds, never decreasing."""

    settings: Settings
    outbox: Outbox
    flight_mode: FlightMode = "stabilised"
    law: Law | None = None  # of the user's
    axes: Axes = field(init=False)
    manoeuvre: Manoeuvre = field(init=False)
    state: VehicleState | None = None  # newest received
    ground: GroundMotion | None = None  # None: not measured now
    t: float = 0.0  # [s] of the newest reference
    _stepped: float = 0.0  # [s] of the reference before
    _place_seen: float = 0.0  # [s] when the position was last measured, or not needed
    _rising: bool = False  # an ascent has begun, or has ended at its depth
    _moved: float | None = None  # [m] jumps of the pressure that the depth has been moved with
    _estimates: dict[str, EstimateWatch] = field(init=False)
    _governors: dict[str, ReferenceGovernor] = field(init=False)
    standstill: Standstill = field(init=False)  # of heave, [m]
    _tilt_limit: TiltLimit = field(init=False)
    held_back: bool = False  # surge and sway, because the vehicle tilts
    near_floor: bool = False  # the stick points down, and leads no nearer to the bottom
    bottom: Bottom = field(default_factory=Bottom)
    height: HeightHold = field(init=False)
    home: Home = field(default_factory=Home)

    def __post_init__(self) -> None:
        s = self.settings
        self.axes = Axes.of(s, self.outbox, self.law)
        self.standstill = Standstill(s.standstill)
        self._tilt_limit = TiltLimit()
        self.height = HeightHold(s.heave.max_velocity, s.failsafe.floor_distance)
        self.manoeuvre = Manoeuvre(self.axes)
        self._estimates = {"depth": EstimateWatch(), "heading": EstimateWatch()}
        self._governors = {
            "depth": ReferenceGovernor(s.heave.max_error),
            "heading": ReferenceGovernor(s.yaw.max_error),
            "place": ReferenceGovernor(s.place.max_error),
        }

    @property
    def held(self) -> HeldAxes:
        return HELD_AXES[self.flight_mode]

    @property
    def limited(self) -> bool:
        """The stick points down, and the reference ends at the depth limit or above the bottom."""
        return self.axes.limited or self.near_floor

    @property
    def settled(self) -> bool:
        """At rest, and not following a path."""
        return self.manoeuvre.following is None and self.axes.settles() <= self.t

    def see(self, state: VehicleState | None, t: float) -> None:
        """Take in a new instant `t` [s] with its state, if any. Where the pressure has jumped, the
        vehicle has not moved: neither must it now."""
        self._stepped, self.t = self.t, max(self.t, t)
        self.ground = None if state is None else ground_of(state)
        self.state = state or self.state
        self._tilt_limit.step(None if state is None else tilt_of(state), self.t - self._stepped)
        if state is None:
            return
        moved = state.depth_moved or 0.0
        before, self._moved = self._moved, moved
        if before is not None and moved != 0.0 and moved != before:
            self.axes.heave.shift(moved - before)
            self.bottom.shift(moved - before)
            by = f"{moved - before:+.2f} m"
            self.outbox.say("info", f"the depth is held {by} from before, as measured")

    @property
    def altitude(self) -> float | UnsetType:
        """[m] Above the bottom now; absent: not measured."""
        if self.state is None or not (self.bottom.known and self.state.depth.valid):
            return UNSET
        return self.bottom.depth(self.t) - self.state.depth.value

    def rest(self) -> None:
        """Set every axis to the vehicle's position, at rest."""
        assert self.state is not None
        self.axes.rest(self.state.depth.value, self.state.heading.value, self.t)
        self._rising = False
        self._place_seen = self.t
        self.height.forget()

    @property
    def unheld(self) -> tuple[str, ...]:
        """Axes that the mode holds, but whose estimates are not valid."""
        held, names = self.held, list[str]()
        if held.depth and self._estimates["depth"].lost:
            names.append("depth")
        if held.heading and self._estimates["heading"].lost:
            names.append("heading")
        return tuple(names)

    def move_on(self, state: VehicleState | None) -> None:  # noqa: C901 - one step, in its order
        """Advance held axes; the others follow the vehicle if there is a state."""
        axes, manoeuvre, t = self.axes, self.manoeuvre, self.t
        if state is not None:
            axes.follow(state, self.held, t)

        # Station keeping begins, goes on, or ends: when the position is not measured for a while,
        # a path goes on by dead reckoning.
        needed = self.held.place or (manoeuvre.on_a_path and manoeuvre.measured)
        if self.ground is not None or state is None or not needed:
            self._place_seen = t
        elif t - self._place_seen > PLACE_PATIENCE_S:
            self.outbox.tell(events.LOST_PLACE())
            manoeuvre.go_blind()
            self.flight_mode = "stabilised" if self.held.place else self.flight_mode
        turns_on_the_spot = manoeuvre.planned is not None and manoeuvre.measured
        if not (turns_on_the_spot or (self.held.place and manoeuvre.following is None)):
            axes.place.held = False
        elif axes.place.held:
            offset = axes.place.offset if state is None else north_offset(state)
            axes.place.step(axes.yaw.at(t), offset, t)
        elif self.ground is not None:
            axes.hold_place(self.ground, t)

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
            if change is None or not holds:
                continue
            if change == "lost":
                self.outbox.tell(events.UNHELD(name))
            else:
                acceleration = ramp.at(t).acceleration  # so that the force makes no step
                ramp.take(Sample(here.value, rate.value, acceleration, 0.0), t)
                self.outbox.say("info", f"the {name} is known again, and held from here on")

    def aim(self, stick: PilotCommand) -> None:
        """Set the axes' targets from the sticks. Where the depth is held, a vehicle that tilts too
        far gets a share of surge and sway."""
        share = self._tilt_limit.share if self.held.depth else 1.0
        before, moves = self.held_back, stick.surge != 0.0 or stick.sway != 0.0
        self.held_back = share < 1.0 and (moves or before)
        if self.held_back and not before:
            self.outbox.tell(events.CLAMPED_HORIZONTAL())
        self.axes.aim(stick, self.held, self.t, share, self._sink(stick.heave))

    def _sink(self, stick: float) -> float | None:
        """[m/s] The velocity of the depth that holds a height, or that ends above the bottom;
        None: the stick's."""
        heave, asked = self.axes.heave, stick * self.settings.heave.max_velocity
        above = heave.at(self.t), heave.limits, self.bottom, self.t
        was_near, self.near_floor = self.near_floor, False
        if not self.bottom.known:
            # A stick that led no nearer leads nowhere until it was let go of: nobody knows any more
            # what it would lead to.
            self.height.forget()
            self.near_floor = was_near and asked > 0.0 and self.held.depth
            return 0.0 if self.near_floor else None
        if self.held.height:
            sink = self.height.velocity(asked, *above)
        else:
            self.height.forget()
            if asked <= 0.0 or not self.held.depth or self.height.floor == 0.0:
                return None
            sink = self.height.sinking(asked, *above)
        self.near_floor = asked > 0.0 and sink < asked
        return sink

    def wait(self, state: VehicleState, *, turn_short: bool = False) -> None:
        """Keep the reference close to a vehicle that cannot follow it.

        Args:
            turn_short: all the thrust there is turns it, and does not suffice; the reference of the
                heading then waits earlier.
        """
        axes, held, t = self.axes, self.held, self.t
        if self.manoeuvre.following is not None:
            self.manoeuvre.following.watch(state, self.ground, t)
            return
        if held.depth:
            deepest = self.settings.failsafe.depth_limit
            self._end_stop(state, deepest)
            self._keep("depth", axes.heave, state.depth, deepest)
        if held.heading:
            most = self.settings.yaw.max_error
            self._governors["heading"].most = min(most, TURN_SHORT) if turn_short else most
            self._keep("heading", axes.yaw, state.heading)
        if axes.place.held and self.ground is not None:
            (north, east), size = axes.place.error(self.ground)
            by = self._share("place", size, *axes.place.now) - 1.0
            if by != 0.0:
                axes.place.shift(north * by, east * by)

    # Requests.

    def change(self, flight_mode: FlightMode) -> None:
        """Change the mode; ends the manoeuvre."""
        self.manoeuvre.end(self.t, hold_place=HELD_AXES[flight_mode].place)
        self.flight_mode = flight_mode

    def end_manoeuvre(self) -> None:
        self.manoeuvre.end(self.t, hold_place=self.held.place)

    def come_to_rest(self) -> None:
        """Failsafe: come to rest smoothly, and hold."""
        self.flight_mode = safe(self.flight_mode)
        self.manoeuvre.come_to_rest(self.t)

    def rise(self, depth: float, speed: float) -> None:
        """Failsafe: rise to a depth [m] at a speed [m/s], unless above it. Called at each step."""
        heave, t = self.axes.heave, self.t
        if self.manoeuvre.following is not None:  # it comes to rest on its path first
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
        """Emergency stop. Returns the stopping distance."""
        self.flight_mode, self.near_floor = safe(self.flight_mode), False
        return self.manoeuvre.stop(self.t)

    # Steps.

    def _end_stop(self, state: VehicleState, deepest: float) -> None:
        """Hold the depth to which a stop of the stick has brought the vehicle, not below `deepest`
        [m]. Where the reference ends at a depth that was asked for, or waits for the vehicle, it
        stays; and without the accelerometer, with which a standstill is known too late."""
        heave, depth, rate = self.axes.heave, state.depth, state.depth_rate
        asked_for = self.manoeuvre.busy or self._rising or self.limited
        known = depth.valid and rate.valid and state.depth_acceleration.valid
        if asked_for or self._governors["depth"].blocked or not known:
            self.standstill.cancel()
            return
        here = heave.at(self.t)
        error = min(depth.value - here.position, max(0.0, deepest - here.position))
        resting = here.velocity == 0.0 == here.acceleration and heave.settles() <= self.t
        by = self.standstill.step(
            error, rate.value, self.t, resting=resting, velocity=here.velocity
        )
        if by != 0.0:
            heave.shift(by)

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

    # The message.

    def reference(
        self,
        state: VehicleState | None,
        command: PilotCommand | None,
        now: Ns,
        *,
        armed_ns: Ns | None,
        epoch: int,
        gripper: float = 0.0,
    ) -> Reference:
        """All axes at this instant, with the stamps of the state and pilot command behind them.
        `armed_ns` None: disarmed; `gripper` as it moves now."""
        axes, held, t = self.axes, self.held, self.t
        # Depth, heading, position and speed along the path, from the axes or from the path.
        depth = _motion(axes.heave, t, held=held.depth)
        heading = _motion(axes.yaw, t, held=held.heading)
        pace, place = _motion(axes.pace, t), axes.place.now if axes.place.held else None
        surge = pace if place is None and pace.velocity != 0.0 else None
        if (following := self.manoeuvre.following) is not None:
            here = following.point(t)
            if following.has_depth:
                depth = Motion(*following.depth(here))
            heading, place = Motion(*following.heading(here)), following.place(here)
            surge = Motion(*following.along(t)) if place is None else None
        surge_force, sway_force = axes.force.at(t)
        return Reference(
            stamp_ns=now,
            sensor_ns=None if state is None else state.sensor_ns,
            pilot_ns=None if command is None else command.stamp_ns,
            epoch=epoch,
            armed=armed_ns is not None,
            armed_ns=armed_ns,
            depth=depth,
            heading=heading,
            surge_force=surge_force.velocity,
            sway_force=sway_force.velocity,
            heave_force=None if held.depth else axes.heave_force.at(t).velocity,
            yaw_moment=None if held.heading else axes.yaw_moment.at(t).velocity,
            surge=surge,
            north=None if place is None else Motion(*place[0]),
            east=None if place is None else Motion(*place[1]),
            tilt=_motion(axes.tilt, t),
            gripper=gripper,
        )


def _motion(ramp: Ramp, t: float, *, held: bool = True) -> Motion:
    """Of an axis; of one that follows the vehicle the jerk is unknown."""
    here = ramp.at(t)
    return (
        Motion(*here, jerk_limit=ramp.in_force.jerk) if held else Motion(*here._replace(jerk=0.0))
    )
