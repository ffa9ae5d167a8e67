"""How a vehicle answers its thrusters, learnt in flight: how much of the thrust, and how much drag.

Of one axis, with the inertia M and the drag D of the vehicle file,

    M v' = κ u - δ D(v) + b,

κ and δ are 1 where the file is right. A sagging battery, a worn propeller and a heavier vehicle all
show in κ, because all that can be seen, and all that matters to the law, is the acceleration per
newton of command. b takes what lasts, as buoyancy does. All sides run through the same low-pass, so
that no velocity is differentiated, and recursive least squares finds the three (Ljung 1999, §11.2).

In a closed loop, thrust that answers a disturbance looks like thrust without effect, and κ would
come out too small. So it learns from nothing but moves that the reference asks for, of a vehicle
that is otherwise calm: hardly any surge or sway, level, no thruster at its limit, not held back. An
estimate close to 1 is not used at all: a vehicle as in its file flies exactly as without.

Surge and sway are the pilot's forces on most vehicles, and their velocity is not measured: nothing
is learnt of them.
"""

from dataclasses import dataclass, field
from math import expm1
from typing import Annotated, NamedTuple

import msgspec

from messages.control import LearntModel
from messages.reference import Reference
from messages.state import VehicleState
from messages.units import Vec6
from services.control.axis.plant import Plant, plant_of
from services.marine.vehicle import Vehicle

CALM_SPEED = 0.25  # [m/s] surge or sway that would be faster disturbs heave and yaw
LEVEL = 0.2  # [rad] of roll and pitch
LOW_PASS_S = 0.3  # [s] of all that is compared
CALM_S = 4.0  # [s] that a vehicle has to be calm before it learns
TAIL_S = 0.7  # [s] after a move that still belong to it
HELD_BACK, HELD_BACK_S = (
    0.3,
    0.5,
)  # [-] of the reference's velocity, or slower; [s] so long: blocked
THRUST_STD, DRAG_STD = 0.3, 0.7  # [-] before anything is known
DRIFT_S = 60.0  # [s] of learning in which the spreads would double
SURE = 2.0  # [-] standard deviations that an estimate has to be away from 1
THRUST_ZONE, DRAG_ZONE = 0.15, 0.35  # [-] from 1; closer is not used …
LEAVE = 0.5  # [-] … and closer than this share of it not any more
RATE = 0.1  # [1/s] at which what is used follows the estimate

LearntScale = Annotated[float, msgspec.Meta(ge=0.2, le=5.0)]
Rows = tuple[float, float, float]
Matrix = tuple[Rows, Rows, Rows]


class AdaptationSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [control.adaptation].

    Raises:
        ValueError: bounds that do not include 1.
    """

    on: bool = True  # False: it is estimated and reported, and not used
    thrust: tuple[LearntScale, LearntScale] = (0.5, 2.0)  # [-] least and most of the file's thrust
    drag: tuple[LearntScale, LearntScale] = (0.4, 2.5)  # [-] least and most of the file's drag
    # [-] Thrust and drag to begin with, of heave and of yaw: what an earlier dive has learnt.
    heave: tuple[LearntScale, LearntScale] = (1.0, 1.0)
    yaw: tuple[LearntScale, LearntScale] = (1.0, 1.0)

    def __post_init__(self) -> None:
        for name, (least, most) in (("thrust", self.thrust), ("drag", self.drag)):
            if not least <= 1.0 <= most:
                raise ValueError(
                    f"{name}: 1 must lie between its bounds, found {least:g}, {most:g}"
                )
        for name, (thrust, drag) in (("heave", self.heave), ("yaw", self.yaw)):
            for what, begin, bounds in (("thrust", thrust, self.thrust), ("drag", drag, self.drag)):
                if not bounds[0] <= begin <= bounds[1]:
                    raise ValueError(
                        f"{name}: it begins with {begin:g} of the {what}, allowed are "
                        f"{bounds[0]:g} to {bounds[1]:g}"
                    )


class ModelNoise(NamedTuple):
    """What an axis does that neither its thrust nor its drag explain."""

    acceleration: float  # [m/s²] or [rad/s²] 1σ, at the low-pass
    lasting: float  # [m/s²] or [rad/s²] 1σ of b before it is known
    drift: float  # [m/s²/√s] or [rad/s²/√s] of b


HEAVE_NOISE, YAW_NOISE = ModelNoise(0.05, 0.15, 0.022), ModelNoise(0.13, 1.3, 0.12)


@dataclass(slots=True)
class UsedScale:
    """One of the two scales as it is used: 1 until the estimate is surely another."""

    zone: float  # [-]
    bounds: tuple[float, float]
    value: float = 1.0  # [-]
    used: bool = False

    def start(self, value: float) -> None:
        """Begin with it; what is learnt may soon be another."""
        self.value, self.used = value, value != 1.0

    def follow(self, estimate: float, std: float, dt: float) -> None:
        away = abs(estimate - 1.0)
        if away > max(self.zone, SURE * std):
            self.used = True
        elif away < LEAVE * self.zone:
            self.used = False
        least, most = self.bounds
        target = max(least, min(most, estimate)) if self.used else 1.0
        self.value += max(-RATE * dt, min(RATE * dt, target - self.value))


@dataclass(slots=True)
class ModelEstimate:
    """The estimate of one axis, and what of it is used."""

    plant: Plant
    noise: ModelNoise
    settings: AdaptationSettings = field(default_factory=AdaptationSettings)
    begin: tuple[float, float] = (1.0, 1.0)  # [-] κ and δ before anything is learnt
    estimate: Rows = field(init=False)  # [-] κ, δ; [m/s²] or [rad/s²] b / M
    thrust: UsedScale = field(init=False)
    drag: UsedScale = field(init=False)
    _spread: Matrix = field(init=False)  # covariance of the estimate
    _filtered: Rows | None = None  # thrust, drag and velocity behind the low-pass
    _force: float = 0.0  # [N] or [N m] of the step before: a command takes effect one step later
    _calm: float = 0.0  # [s]
    _since_move: float = TAIL_S  # [s]
    _held_back: float = 0.0  # [s]

    def __post_init__(self) -> None:
        thrust, drag = self.begin
        self.estimate = thrust, drag, 0.0
        self.thrust = UsedScale(THRUST_ZONE, self.settings.thrust)
        self.drag = UsedScale(DRAG_ZONE, self.settings.drag)
        if self.settings.on:
            self.thrust.start(thrust)
            self.drag.start(drag)
        a, b, c = THRUST_STD**2, DRAG_STD**2, self.noise.lasting**2
        self._spread = (a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c)

    @property
    def learnt(self) -> LearntModel:
        """For the bus."""
        thrust, drag, _ = self.estimate
        return LearntModel(thrust, drag, self.thrust.value, self.drag.value)

    @property
    def model(self) -> Plant:
        """The plant with the drag that is used, per inertia of the vehicle file."""
        p, scale = self.plant, self.drag.value
        if scale == 1.0:
            return p
        return p._replace(linear=scale * p.linear, quadratic=scale * p.quadratic)

    def step(
        self, velocity: float | None, force: float, dt: float, reference: float, *, calm: bool
    ) -> None:
        """Take in one step.

        Args:
            velocity: [m/s] or [rad/s] relative to the water; None: not known.
            force: [N] or [N m] mean of the commands' thrust since the last call, as of the file.
            dt: [s] since the last call.
            reference: [m/s] or [rad/s] velocity that is asked for; 0 at rest.
            calm: nothing but this axis and heave or yaw is asked for, and no thruster is at its
                limit.
        """
        force, self._force = self._force, force
        if velocity is None or dt <= 0.0:
            self._filtered, self._calm = None, 0.0
            return
        # Is it a move of a calm vehicle, which is not held back?
        self._since_move = 0.0 if reference != 0.0 else self._since_move + dt
        follows = reference == 0.0 or velocity / reference > HELD_BACK
        self._held_back = 0.0 if follows else self._held_back + dt
        still_calm = calm and self._held_back < HELD_BACK_S
        self._calm = self._calm + dt if still_calm else 0.0
        excited = self._calm > CALM_S and self._since_move < TAIL_S and follows
        # All sides through the low-pass; its first step has no acceleration.
        drag = self.plant.drag(velocity)
        if self._filtered is None:
            self._filtered = force, drag, velocity
        else:
            share = -expm1(-dt / LOW_PASS_S)
            u, d, v = self._filtered
            u, d, v = u + share * (force - u), d + share * (drag - d), v + share * (velocity - v)
            self._filtered = u, d, v
            if excited:
                self._update(u, d, (velocity - v) / LOW_PASS_S, dt)
        # What is used follows.
        if self.settings.on:
            (a, _, _), (_, b, _), _ = self._spread
            self.thrust.follow(self.estimate[0], a**0.5, dt)
            self.drag.follow(self.estimate[1], b**0.5, dt)

    def pause(self) -> None:
        """The vehicle is disarmed, or its motion was not seen for a while. What is learnt stays."""
        self._filtered, self._calm, self._since_move, self._held_back = None, 0.0, TAIL_S, 0.0

    def _update(self, u: float, d: float, acceleration: float, dt: float) -> None:
        """Recursive least squares; samples within the low-pass are not independent.

        Args:
            u, d: [N] or [N m] thrust and drag behind the low-pass.
            acceleration: [m/s²] or [rad/s²] behind the low-pass.
        """
        x, y = u / self.plant.inertia, -d / self.plant.inertia  # regressors, and 1 for b
        (aa, ab, ac), (_, bb, bc), (_, _, cc) = self._spread
        grows = 1.0 + dt / DRIFT_S
        aa, bb = min(THRUST_STD**2, aa * grows), min(DRAG_STD**2, bb * grows)
        cc += self.noise.drift**2 * dt
        pa, pb, pc = aa * x + ab * y + ac, ab * x + bb * y + bc, ac * x + bc * y + cc
        total = x * pa + y * pb + pc + 2.0 * LOW_PASS_S / dt * self.noise.acceleration**2
        ka, kb, kc = pa / total, pb / total, pc / total
        thrust, drag, lasting = self.estimate
        off = acceleration - thrust * x - drag * y - lasting
        least, most = self.settings.thrust
        low, high = self.settings.drag
        self.estimate = (
            max(least, min(most, thrust + ka * off)),
            max(low, min(high, drag + kb * off)),
            lasting + kc * off,
        )
        ab, ac, bc = ab - ka * pb, ac - ka * pc, bc - kb * pc
        self._spread = (aa - ka * pa, ab, ac), (ab, bb - kb * pb, bc), (ac, bc, cc - kc * pc)


@dataclass(slots=True)
class Adaptation:
    """What is learnt of heave and yaw in flight, and when the vehicle is calm enough to learn."""

    settings: AdaptationSettings
    vehicle: Vehicle
    heave: ModelEstimate = field(init=False)
    yaw: ModelEstimate = field(init=False)
    _most: tuple[float, float] = field(init=False)  # [N] surge and sway of a calm vehicle
    _calm: bool = False  # since the last step, as far as the commands go
    _rates: tuple[float, float] = (0.0, 0.0)  # [m/s, rad/s] heave and yaw asked for, 0: not held

    def __post_init__(self) -> None:
        v, s = self.vehicle, self.settings
        self.heave = ModelEstimate(plant_of(v, 2), HEAVE_NOISE, s, s.heave)
        self.yaw = ModelEstimate(plant_of(v, 5), YAW_NOISE, s, s.yaw)
        self._most = plant_of(v, 0).drag(CALM_SPEED), plant_of(v, 1).drag(CALM_SPEED)

    def learn(
        self,
        state: VehicleState,
        heave: tuple[float | None, float],
        yaw: tuple[float | None, float],
        dt: float,
    ) -> None:
        """Take in the `dt` [s] since the last step.

        Args:
            heave, yaw: velocity [m/s, rad/s], None: not known; and mean thrust of the commands
                [N, N m], as of the vehicle file.
        """
        s, submerged = state, state.depth.value > self.vehicle.size[2]
        level = not s.roll.valid or abs(s.roll.value) < LEVEL
        level = level and (not s.pitch.valid or abs(s.pitch.value) < LEVEL)
        calm = self._calm and level
        self.heave.step(*heave, dt, self._rates[0], calm=calm and submerged)
        self.yaw.step(*yaw, dt, self._rates[1], calm=calm)

    def commands(self, reference: Reference, wanted: Vec6) -> Vec6:
        """The commands [N, N m], as of the vehicle file, that yield the wrench `wanted` for the
        reference until the next step."""
        r, (x, y, z, k, m, n) = reference, wanted
        self._rates = (
            0.0 if r.heave_force is not None else r.depth.velocity,
            0.0 if r.yaw_moment is not None else r.heading.velocity,
        )
        self._calm = abs(x) < self._most[0] and abs(y) < self._most[1]
        return x, y, z / self.heave.thrust.value, k, m, n / self.yaw.thrust.value

    def saturated(self) -> None:
        """A thruster is at its limit."""
        self._calm = False

    def pause(self) -> None:
        self.heave.pause()
        self.yaw.pause()
