"""One axis: the thesis' control law, with state feedback, feed-forward, an integral or a
disturbance observer, and gains for holding still and for moving; what it does without a position;
and the transfer between its modes.

u = L_r r - L x̂ + L_I e (Andrén 2023, 5.26 to 5.31), with position, velocity and acceleration
references. The feed-forward of acceleration and drag uses the vehicle's own mass and damping, so
feedback only acts on disturbances. Lasting disturbances are learnt by an integral, or by a
disturbance observer in its place. Three anti-windup guards: the position error is clamped, the
integral is clamped, and an integral that opposes a large error decays. The first two apply to the
observer as well.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from typing import Annotated

import msgspec

from messages import events
from messages.events import Event
from messages.message import Estimate
from messages.reference import Motion
from messages.units import NotNegativeSetting, Positive
from services.control.axis.plant import DisturbanceObserver, Plant, clamped

Percent = Annotated[float, msgspec.Meta(ge=0.0, le=200.0)]
DragDoubt = Annotated[float, msgspec.Meta(ge=0.0, le=5.0)]
WIDEST = 50.0  # [rad/s]
Bandwidth = Annotated[float, msgspec.Meta(ge=0.0, le=WIDEST)]
BLOCKED = 0.2  # [-] of the reference velocity; a slower vehicle does not move freely
LATE_SPRING, LATE_DAMPER = 0.15, 0.4  # [-] of kp and kd while the rate is delayed
LATE_INTEGRAL = 0.15  # [-] of ki; the observer needs a rate that is not late
LEAST_DRAG_SPEED = 1e-3  # position units per second
DECAY = 0.98  # [-] per step; guard 3
MOVING = 1e-6  # any smaller reference velocity or acceleration is rest


class StaticGains(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Gains while the reference rests."""

    kp: NotNegativeSetting  # [N/m or N m/rad]
    kd: NotNegativeSetting  # [N s/m or N m s/rad]
    zone: NotNegativeSetting = 0.0  # [m or rad] dead zone of the error
    leave: Positive = 0.1  # [m or rad] a larger error switches to the moving gains
    blend: Annotated[float, msgspec.Meta(ge=0.01, le=10.0)] = 0.5  # [s] from one set to the other

    def __post_init__(self) -> None:
        if self.zone >= self.leave:
            raise ValueError(f"zone is {self.zone:g}, it must be smaller than leave {self.leave:g}")


class FeedbackGains(msgspec.Struct, frozen=True, gc=False):
    """The gains in force."""

    kp: float
    kd: float
    zone: float

    def spring(self, error: float) -> float:
        """Restoring force, zero inside the zone. It is continuous at the edge and passive, so it
        cannot sustain an oscillation."""
        return self.kp * (error - max(-self.zone, min(self.zone, error)))


class Gains(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Of one axis, a force or a moment."""

    kp: NotNegativeSetting  # [N/m or N m/rad]
    kd: NotNegativeSetting  # [N s/m or N m s/rad]
    ki: NotNegativeSetting  # [N/(m s) or N m/(rad s)]
    max_error: Positive  # [m or rad] guard 1
    max_integral: NotNegativeSetting  # [N or N m] guard 2, well below a saturated thruster
    observer: Bandwidth = 0.0  # [rad/s] of the disturbance observer; 0: the integral instead
    drag_speed: NotNegativeSetting = 0.0  # [m/s or rad/s] drag is learnt above; 0: off
    drag_doubt: DragDoubt = 0.0  # [-] of the model's drag: guard 2 is wider by it in motion
    still: NotNegativeSetting = 0.0  # [m/s or rad/s] below, it learns as slowly as ki
    decay_threshold: Positive = 0.1  # [m or rad] guard 3 acts on errors larger than this
    acceleration_percent: Percent = 100.0  # [%] of the acceleration feed-forward; 100 is exact
    drag_percent: Percent = 100.0  # [%] of the drag feed-forward
    lead_percent: Percent = 100.0  # [%] of the thrusters' lag that the feed-forward leads by
    drag_lead_percent: Percent = 0.0  # [%] of that lag that the learnt drag leads by
    static: StaticGains | None = None  # other gains while the reference rests

    def __post_init__(self) -> None:
        # Squares of speeds divided by it must stay finite.
        if 0.0 < self.drag_speed < LEAST_DRAG_SPEED:
            raise ValueError(
                f"drag_speed is {self.drag_speed:g}, allowed are 0 and {LEAST_DRAG_SPEED:g} or more"
            )


@dataclass(slots=True)
class GainBlend:
    """Two sets of gains, for holding still and for moving, and those in force. Begins with the
    static ones.

    The moving gains make a thruster with a dead-band start and stop for ever at rest; the static
    gains follow a moving reference badly (Andrén 2023, 5.4.2). The share of the moving set goes
    from 0 to 1 along a curve with zero slope at both ends.
    """

    moving: FeedbackGains
    static: StaticGains | None
    _blend: float = 0.0  # [-] from static to moving, before smoothing
    _disturbed: bool = False  # the error has switched to the moving gains

    def step(self, moves: bool, error: float, dt: float) -> FeedbackGains:
        """Gains of this step; the arguments take effect from the next step on."""
        static = self.static
        if static is None:
            return self.moving
        share = self._blend * self._blend * (3 - 2 * self._blend)
        now = FeedbackGains(
            static.kp + share * (self.moving.kp - static.kp),
            static.kd + share * (self.moving.kd - static.kd),
            static.zone * (1 - share),
        )
        if abs(error) > static.leave:
            self._disturbed = True
        elif abs(error) <= static.leave / 2:
            self._disturbed = False
        target = 1.0 if moves or self._disturbed else 0.0
        most = dt / static.blend
        self._blend += max(-most, min(most, target - self._blend))
        return now


@dataclass(slots=True)
class Axis:
    """How one axis is held, or driven by the pilot's force."""

    gains: Gains
    plant: Plant
    lag: float = 0.0  # [s] time constant of its thrusters
    period: float = 0.01  # [s] for which an effort is held
    name: str = ""  # as in the vehicle file
    count: Callable[[Event], None] = lambda _: None  # called with what limits it, at every step
    fade: float = 0.3  # [s] from one mode to another
    own: bool = True  # it needs a lasting force to rest, as buoyancy does; False: none
    _observer: DisturbanceObserver = field(init=False)  # its estimate is minus the integral, too
    _blend: GainBlend = field(init=False)
    _feedback: FeedbackGains | None = None  # gains of the previous step
    _late: bool = False  # the rate, at the last step
    _blind: bool = False  # the position has not been known since
    _still: float = 0.0  # position units per second; a slower vehicle counts as not moving
    _slow: float = 0.0  # [N/s] or [N m/s] fastest learning without motion
    _reference_rate: float = 0.0  # position units per second, of the newest reference
    _soon: float = 0.0  # position units per second, by which it is another when thrust follows
    # A change of the axis' mode makes no step: the force of the old one fades into the new one's.
    _mode: str | None = None  # at the last step; None: not yet stepped
    _total: float = 0.0  # [N] or [N m] output of the last step
    _offset: float = 0.0  # [N] or [N m] old minus new at the change
    _left: float = 0.0  # [-] of the offset

    def __post_init__(self) -> None:
        g = self.gains
        self._observer = DisturbanceObserver(
            self.plant, g.observer, g.max_integral, g.drag_speed or inf, g.drag_doubt
        )
        self._blend = GainBlend(FeedbackGains(g.kp, g.kd, 0.0), g.static)

    # Its modes.

    def held(
        self,
        motion: Motion,
        position: Estimate,
        rate: Estimate,
        dt: float,
        *,
        late: bool = False,
        extra: float = 0.0,
        upright: float = 1.0,
    ) -> float:
        """Effort [N] or [N m] that brings the axis to its reference. Without a valid position
        there is no spring, see `blind`. `late`: the rate is delayed, so feedback gains are lower.
        """
        if not (position.valid and rate.valid):
            self.count(events.INVALID(f"state.{self.name}"))
            damped = rate.value if rate.valid else None
            return self.blind(motion, dt, extra, rate=damped, upright=upright)
        if late and not self._late:
            self._observer.recall()
        self._late = late
        if late:
            self.count(events.LATE(f"state.{self.name}"))
        return self.fed_back(
            motion, position.value, rate.value, dt, late=late, extra=extra, upright=upright
        )

    def fed_back(
        self,
        motion: Motion,
        position: float,
        rate: float,
        dt: float,
        *,
        water: float = 0.0,
        extra: float = 0.0,
        late: bool = False,
        upright: float = 1.0,
    ) -> float:
        """As `held`, in a current `water` and with an additional force `extra`."""
        self._blind = False
        total = self.step(motion, position, rate, dt, water, late=late)
        return self._transferred("held", (total + extra) / upright, dt)

    def blind(
        self,
        motion: Motion,
        dt: float,
        extra: float = 0.0,
        *,
        rate: float | None = None,
        upright: float = 1.0,
    ) -> float:
        """Effort without a position: feed-forward, damping of a known rate, and compensation.

        What was learnt last may be of the estimate that has just turned out to be wrong. So the
        compensation fades to what was learnt before that and nothing more is learnt; where a
        vehicle at rest needs no force, as in yaw, it fades to zero.
        """
        if not self._blind and self.own:
            self._observer.recall()
        elif not self._blind:
            self._observer.forget()
        self._blind, self._late = True, False
        moves = self._see(motion)
        kd = self._blend.step(moves, 0.0, self.period).kd
        damping = 0.0 if rate is None else kd * (motion.velocity - rate)
        total = (damping + self.feed_forward(motion) + self.standing + extra) / upright
        return self._transferred("blind" if rate is None else "damped", total, dt)

    def forced(self, force: float, dt: float) -> float:
        """The pilot's force; the axis is not held, and there is no error to learn from."""
        self._blind = False
        self._reference_rate, self._soon = 0.0, 0.0
        self._slow, self._still = 0.0, self.gains.still
        return self._transferred("forced", force, dt)

    def _transferred(self, mode: str, force: float, dt: float) -> float:
        """The output [N] or [N m], for the `force` that `mode` requires: at a mode change that of
        the previous step; then the difference fades linearly."""
        if self._mode not in (None, mode):
            self._offset, self._left = self._total - force, 1.0
        else:
            self._left = max(0.0, self._left - dt / self.fade)
        self._mode = mode
        self._total = force + self._left * self._offset
        return self._total

    # The law.

    def step(
        self,
        reference: Motion,
        position: float,
        rate: float,
        dt: float,
        water: float = 0.0,
        *,
        late: bool = False,
    ) -> float:
        """Effort [N] or [N m] for a reference and an estimate at the same instant.

        Args:
            position, rate: estimate, same units as the reference.
            dt: [s] since the last step.
            water: velocity of the water along the axis, in the frame of `rate`.
            late: the rate is a third of a second old, as from pressure alone; the full gains would
                make the loop oscillate.
        """
        moves = self._see(reference)
        error = reference.position - position
        near = clamped(error, self.gains.max_error)
        feedback = self._blend.step(moves, near, dt)
        if self.gains.observer == 0.0:
            at_limit = self._integrate(near, feedback, moves, dt)
        else:
            at_limit = self._observer.is_limited(reference.velocity)
            outside = near - clamped(near, feedback.zone)
            self._slow = 0.0 if moves else self.gains.ki * abs(outside)
            self._still = self.gains.still + BLOCKED * abs(reference.velocity)
            if abs(error) > self.gains.decay_threshold:
                self._still = inf
            if late and not moves:
                self._observer.integrate(LATE_INTEGRAL * self.gains.ki * near * dt)
        if near != error or at_limit:
            self.count(events.CLAMPED(f"control.{self.name}"))
        spring, damper = (LATE_SPRING, LATE_DAMPER) if late else (1.0, 1.0)
        total = spring * feedback.spring(near)
        total += damper * feedback.kd * (reference.velocity - rate)
        return total + (self.feed_forward(reference, water) + self.standing)

    def feed_forward(self, reference: Motion, water: float = 0.0) -> float:
        """Force, held over the period, that moves the undisturbed plant from this reference to the
        next: exact for the linear part, evaluated at mid-step for the quadratic drag.

        With thruster lag T a command u produces the force f with T f' + f = u, so the command is
        the force due T later, to first order.
        """
        g, plant, half = self.gains, self.plant, self.period / 2
        a, v = reference.acceleration, reference.velocity - water
        ahead = g.lead_percent / 100 * self.lag
        soon = v + (half + ahead) * a
        inertia = plant.sampled_inertia(self.period) * (a + (half + ahead) * reference.jerk)
        drag = plant.linear * (v + ahead * a) + plant.quadratic * soon * abs(soon)
        return (g.acceleration_percent * inertia + g.drag_percent * drag) / 100

    def _see(self, reference: Motion) -> bool:
        """Take in the reference of this step. Does it move?"""
        self._reference_rate = reference.velocity
        self._soon = self.gains.drag_lead_percent / 100 * self.lag * reference.acceleration
        return abs(reference.velocity) > MOVING or abs(reference.acceleration) > MOVING

    # What it has learnt.

    @property
    def standing(self) -> float:
        """[N] or [N m] Compensation of lasting disturbances."""
        return -self._observer.expected(self._reference_rate + self._soon)

    def learn(self, velocity: float | None, force: float, dt: float, *, short: float = 0.0) -> None:
        """Update the observer: velocity relative to the water now, and mean thruster force since
        the last call. Nothing is learnt from a step whose velocity, or position, is not known.

        A vehicle that does not move may lie on the sea floor, which opposes any force. So without
        motion it learns no faster than the integral would, and not at all while the reference
        moves.

        Args:
            short: [N] or [N m] effort that could not be had; only less is learnt then.
        """
        if velocity is None or self._blind or self.gains.observer == 0.0:
            self._observer.pause()
            return
        most = self._slow * dt if abs(velocity) < self._still else inf
        self._observer.learn(velocity, force, dt, most, self._reference_rate, short)

    def give_up(self, force: float) -> None:
        """The feed-forward gives `force` [N] or [N m] more from now on: subtract it from the learnt
        compensation, which does not change sign."""
        learnt = self.standing
        low, high = min(0.0, learnt), max(0.0, learnt)
        self._set_standing(learnt - max(low, min(high, force)))

    def take_over(self, force: float) -> None:
        """The feed-forward gives `force` [N] or [N m] less from now on: add it to the learnt
        compensation."""
        self._set_standing(clamped(self.standing + force, self.gains.max_integral))

    def _set_standing(self, force: float) -> None:
        drag = self._observer.drag * (self._reference_rate + self._soon)
        self._observer.estimate = -force - drag
        self._observer.pause()

    def pause(self, *, stopped: bool = False) -> None:
        """Learn nothing from this step. `stopped`: nor does the next one transfer a force."""
        self._observer.pause()
        if stopped:
            self._mode, self._left = None, 0.0

    def forget(self) -> None:
        """Begin anew, as after a disarm."""
        self._blind = self._late = False
        self._observer.forget()
        self.pause(stopped=True)

    def _integrate(self, error: float, feedback: FeedbackGains, moves: bool, dt: float) -> bool:
        """(5.28) to (5.31). Returns whether the integral is at its limit. Paused while the
        reference moves: the integral is for buoyancy. No integration inside the static zone; the
        feedback lost when the gains blend to rest is added to the integral."""
        g, learnt = self.gains, self._observer
        before, self._feedback = self._feedback or feedback, feedback
        if learnt.estimate * error > 0 and abs(error) > g.decay_threshold:
            learnt.estimate *= DECAY
            return False
        if moves:
            learnt.lasting.move()
            return False
        given_up = before.spring(error) - feedback.spring(error)
        outside = error - clamped(error, feedback.zone)
        wanted = learnt.estimate - given_up - g.ki * outside * dt
        learnt.estimate = clamped(wanted, g.max_integral)
        learnt.lasting.add(learnt.estimate, dt)
        return wanted != learnt.estimate
