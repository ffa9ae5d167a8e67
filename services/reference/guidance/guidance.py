"""Guidance: the held axes, their reference, and the current manoeuvre.

A mode change needs no special handling: the reference of an axis that is not held follows the
vehicle, and holding the axis stops that. A force reference begins at zero when its axis is released
and ends when the axis is held; control makes the hand-over bumpless.
"""

from dataclasses import dataclass, field
from math import inf

from messages.message import Estimate
from messages.pilot import Hold, PilotCommand, StopDistance
from messages.state import VehicleState
from services.reference.guidance.axes import Axes
from services.reference.guidance.estimate_watch import EstimateWatch
from services.reference.guidance.ground_motion import GroundMotion, ground_of, north_offset
from services.reference.guidance.manoeuvre import Manoeuvre
from services.reference.guidance.modes import HOLDS, HeldAxes, safe
from services.reference.guidance.reference_governor import ReferenceGovernor, is_released
from services.reference.guidance.standstill import Standstill
from services.reference.guidance.tilt_limit import TiltLimit, tilt_of
from services.reference.settings import Settings
from services.reference.trajectory.minimum_jerk import Ramp, Sample

RISEN = 0.01  # [m] an ascent that ends this close to its depth has reached it
TURN_SHORT = 0.04  # [rad] largest error of a heading for which there is not enough thrust
PLACE_PATIENCE_S = 2.0  # [s] without a position measurement before station keeping ends


@dataclass(slots=True)
class Guidance:
    """`events` collects names to count, `notes` texts to log. Times `t` in seconds, never
    decreasing."""

    settings: Settings
    hold: Hold = "stabilised"
    events: list[str] = field(default_factory=list[str])
    notes: list[str] = field(default_factory=list[str])
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

    def __post_init__(self) -> None:
        s = self.settings
        self.axes, self.standstill = Axes.of(s), Standstill(s.standstill)
        self._tilt_limit = TiltLimit(s.most_tilt)
        self.manoeuvre = Manoeuvre(self.axes)
        self._estimates = {"depth": EstimateWatch(), "heading": EstimateWatch()}
        self._governors = {
            "depth": ReferenceGovernor(s.heave.max_error),
            "heading": ReferenceGovernor(s.yaw.max_error),
            "place": ReferenceGovernor(s.place.max_error),
        }

    @property
    def held(self) -> HeldAxes:
        return HOLDS[self.hold]

    @property
    def settled(self) -> bool:
        """At rest, and not following a path."""
        return self.manoeuvre.following is None and self.axes.settles() <= self.t

    def see(self, state: VehicleState | None, t: float) -> None:
        """Take in a new instant `t` [s] with its state, if any."""
        self._stepped, self.t = self.t, max(self.t, t)
        self.ground = None if state is None else ground_of(state)
        self.state = state or self.state
        self._tilt_limit.step(None if state is None else tilt_of(state), self.t - self._stepped)
        if state is not None:
            self._move_with_the_pressure(state.depth_moved or 0.0)

    def rest(self) -> None:
        """Set every axis to the vehicle's position, at rest."""
        assert self.state is not None
        self.axes.rest(self.state.depth.value, self.state.heading.value, self.t)
        self._rising = False
        self._place_seen = self.t

    def move_on(self, state: VehicleState | None) -> None:
        """Advance held axes; the others follow the vehicle if there is a state."""
        if state is not None:
            self.axes.follow(state, self.held, self.t)
        self._update_place(state)

    @property
    def unheld(self) -> tuple[str, ...]:
        """Axes that the mode holds, but whose estimates are not valid."""
        held = {"depth": self.held.depth, "heading": self.held.heading}
        return tuple(name for name, watch in self._estimates.items() if watch.lost and held[name])

    def watch_estimates(self, state: VehicleState | None) -> None:
        """Notice depth or heading that is no longer known. Once it is known again, the vehicle is
        held where it is then. Without a state, there is a failsafe already."""
        if state is None:
            return
        s, held = state, self.held
        for name, ramp, here, rate, holds in (
            ("depth", self.axes.heave, s.depth, s.depth_rate, held.depth),
            ("heading", self.axes.yaw, s.heading, s.yaw_rate, held.heading),
        ):
            change = self._estimates[name].see(valid=here.valid and rate.valid, t=self.t)
            if change is None or not holds:
                continue
            if change == "lost":
                self.events.append(f"unheld:{name}")
            else:
                acceleration = ramp.at(self.t).acceleration  # so that the force makes no step
                ramp.take(Sample(here.value, rate.value, acceleration, 0.0), self.t)
                self.notes.append(f"the {name} is known again, and held from here on")

    def _move_with_the_pressure(self, moved: float) -> None:
        """Where the pressure has jumped, the vehicle has not moved: neither must it now."""
        before, self._moved = self._moved, moved
        if before is not None and moved != 0.0 and moved != before:
            self.axes.heave.shift(moved - before)
            self.notes.append(f"the depth is held {moved - before:+.2f} m from before, as measured")

    def aim(self, stick: PilotCommand) -> None:
        """Set the axes' targets from the sticks. Where the depth is held, a vehicle that tilts too
        far gets a share of surge and sway."""
        share = self._tilt_limit.share if self.held.depth else 1.0
        before, moves = self.held_back, stick.surge != 0.0 or stick.sway != 0.0
        self.held_back = share < 1.0 and (moves or before)
        if self.held_back and not before:
            self.events.append("clamped:reference.horizontal")
        self.axes.aim(stick, self.held, self.t, share)

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
            by = self._share("place", size, released=is_released(*axes.place.now)) - 1.0
            if by != 0.0:
                axes.place.shift(north * by, east * by)

    # Requests.

    def change(self, hold: Hold) -> None:
        """Change the mode; ends the manoeuvre."""
        self.manoeuvre.end(self.t, hold_place=HOLDS[hold].place)
        self.hold = hold

    def end_manoeuvre(self) -> None:
        self.manoeuvre.end(self.t, hold_place=self.held.place)

    def come_to_rest(self) -> None:
        """Failsafe: come to rest smoothly, and hold."""
        self.hold = safe(self.hold)
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
        self.hold = safe(self.hold)
        return self.manoeuvre.stop(self.t)

    # Steps.

    def _update_place(self, state: VehicleState | None) -> None:
        """Begin, continue or end station keeping; ends when the position is not measured."""
        axes, manoeuvre, t = self.axes, self.manoeuvre, self.t
        needed = self.held.place or (manoeuvre.on_a_path and manoeuvre.measured)
        if self.ground is not None or state is None or not needed:
            self._place_seen = t
        elif t - self._place_seen > PLACE_PATIENCE_S:
            self._lose_the_place()
        if not (manoeuvre.turns_on_the_spot or (self.held.place and manoeuvre.following is None)):
            axes.place.held = False
        elif axes.place.held:
            offset = axes.place.offset if state is None else north_offset(state)
            axes.place.step(axes.yaw.at(t), offset, t)
        elif self.ground is not None:
            axes.hold_place(self.ground, t)

    def _lose_the_place(self) -> None:
        self.events.append("lost:place")
        self.notes.append("the place is not measured any more: depth and heading are still held")
        self.manoeuvre.go_blind()
        self.hold = "stabilised" if self.held.place else self.hold

    def _end_stop(self, state: VehicleState, deepest: float) -> None:
        """Hold the depth to which a stop of the stick has brought the vehicle, not below `deepest`
        [m]. Where the reference ends at a depth that was asked for, or waits for the vehicle, it
        stays; and without the accelerometer, with which a standstill is known too late."""
        heave, depth, rate = self.axes.heave, state.depth, state.depth_rate
        asked_for = self.manoeuvre.busy or self._rising or self.axes.limited
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
            by = self._share(name, abs(error), released=is_released(here)) - 1.0
            if by != 0.0:
                ramp.shift(min(error * by, max(0.0, deepest - here.position)))

    def _share(self, name: str, size: float, *, released: bool) -> float:
        governor = self._governors[name]
        before = governor.blocked
        share = governor.keep(size, self.t - self._stepped, released=released)
        if governor.blocked and not before:
            self.events.append(f"clamped:reference.{name}")
        return share
