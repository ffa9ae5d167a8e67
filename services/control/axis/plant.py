"""The law's model of one axis of the vehicle, M v' = u - D(v) + w, of the thrusters' lag, and the
observer of w: the external force, estimated from motion that the thrusters do not explain.

The observer is the first-order filter ŵ' = ω (w - ŵ), which needs no derivative of the velocity
when written with z = ŵ - ω M v:

    z' = -ω z - ω (ω M v + u - D(v)),   ŵ = z + ω M v.

Here it is discretised exactly: the estimate moves by the share 1 - exp(-ω dt) towards the force w
that explains the last step of the sampled plant (see `Plant.sampled_inertia`). A constant
disturbance is estimated without error, and its compensation replaces an integrator.

In surge, a drone has more drag in heave and yaw than at rest, and that extra force vanishes when
heave or yaw stop. So what is learnt during motion is split into a drag proportional to the
reference velocity and a constant (normalised least mean squares, regressors 1 and v / v₀). Without
motion the drag decays, because the next motion may have another surge speed.
"""

from collections import deque
from dataclasses import dataclass, field
from math import exp, expm1, inf
from statistics import median
from typing import NamedTuple, cast

from messages.units import Vec6
from services.marine.hydrodynamics import system_inertia
from services.marine.vehicle import Vehicle, wrench_per_newton

NEARLY = 0.99  # [-] of the limit, which the estimate only approaches
DRAG_DECAY = 1.0  # [s] time constant of the drag without motion

SETTLES = 1.0  # [s] after a motion, while what is learnt is still of that motion
BLOCK = 1.0  # [s] of learning, of which the mean is kept
KEPT = 45  # blocks
DOUBTED = 15  # newest blocks, not used if there are enough older ones: longer than any recognition
SHARE = 3  # early in a dive, at most one block in so many is not used

REST: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
Lags = tuple[float, ...]


class Plant(NamedTuple):
    """Inertia and drag of one axis."""

    inertia: float  # [kg] or [kg m²], added mass included
    linear: float = 0.0  # [N s/m] or [N m s/rad]
    quadratic: float = 0.0  # [N s²/m²] or [N m s²/rad²]

    def drag(self, velocity: float) -> float:
        """D(v) [N] or [N m], linear and quadratic (Andrén 2023, 7.2.5)."""
        return (self.linear + self.quadratic * abs(velocity)) * velocity

    def sampled_inertia(self, dt: float) -> float:
        """[kg] or [kg m²] Effective inertia for a force held over `dt` [s].

        The exact solution of m v' = u - d v over one step, v₊ = φ v + (1 - φ) u / d with
        φ = exp(-d dt / m), reads (v₊ - v) / dt = (u - d v) / m_s with this m_s. It is m + d dt / 2
        to first order.
        """
        x = self.linear * dt / self.inertia
        return self.inertia if x == 0.0 else self.inertia * x / -expm1(-x)


def plant_of(vehicle: Vehicle, axis: int) -> Plant:
    """The axis 0 … 5 (X, Y, Z, K, M, N) of a vehicle, added mass included."""
    return Plant(
        inertia=system_inertia(vehicle)[axis],
        linear=vehicle.linear_damping[axis],
        quadratic=vehicle.quadratic_damping[axis],
    )


@dataclass(slots=True)
class ActuatorModel:
    """A model of the wrench, axis by axis, with the lag of each axis' slowest thruster."""

    lags: Lags  # [s] of the six axes
    _now: Vec6 = REST  # [N, N m]
    settles_at: Vec6 = REST  # [N, N m] at which the thrusters settle from now on

    def mean(self, dt: float) -> Vec6:
        """Advance by `dt` [s]; returns the mean wrench [N, N m] over that time."""
        if dt <= 0.0:
            return self._now
        means, after = list[float](), list[float]()
        for force, end, lag in zip(self._now, self.settles_at, self.lags, strict=True):
            left = exp(-dt / lag)
            means.append(end + (force - end) * (1 - left) * lag / dt)
            after.append(end + (force - end) * left)
        self._now = cast(Vec6, tuple(after))
        return cast(Vec6, tuple(means))


def lags_of(vehicle: Vehicle) -> Lags:
    """[s] Of each axis: the longest of the thrusters that act on it."""
    slowest = max(t.time_constant for t in vehicle.thruster)
    acts = [(wrench_per_newton(t), t.time_constant) for t in vehicle.thruster]
    return tuple(max((lag for column, lag in acts if column[k]), default=slowest) for k in range(6))


@dataclass(slots=True)
class LastingValue:
    """What an axis at rest has learnt over a longer time, [N] or [N m], and what of it is from
    before a fault: a sensor that goes wrong is found out some seconds later, and until then the
    axis learns from it. Time counts while there is learning."""

    _blocks: deque[float] = field(default_factory=lambda: deque[float](maxlen=KEPT))
    _rested: float = 0.0  # [s] since the last motion
    _sum: float = 0.0  # [N s] or [N m s] of this block
    _seconds: float = 0.0  # [s] in it

    @property
    def trusted(self) -> float:
        """[N] or [N m] Median of the older blocks; zero before there are any."""
        count = len(self._blocks)
        older = list(self._blocks)[: count - min(DOUBTED, count // SHARE)]
        return median(older) if older else 0.0

    def add(self, value: float, dt: float) -> None:
        """Learnt now at rest, `dt` [s] after the last one."""
        self._rested += dt
        if self._rested < SETTLES:
            return
        self._sum += value * dt
        self._seconds += dt
        if self._seconds >= BLOCK:
            self._blocks.append(self._sum / self._seconds)
            self._sum = self._seconds = 0.0

    def move(self) -> None:
        """The vehicle is not at rest."""
        self._rested = self._sum = self._seconds = 0.0

    def forget(self) -> None:
        self.move()
        self._blocks.clear()


@dataclass(slots=True)
class DisturbanceObserver:
    plant: Plant
    bandwidth: float  # [rad/s] ω
    limit: float  # [N] or [N m] largest estimate at rest
    drag_speed: float = inf  # [m/s] or [rad/s] v₀; at much lower speed, all counts as constant
    drag_doubt: float = 0.0  # [-] of the model's drag, by which the limit is wider in motion
    estimate: float = 0.0  # [N] or [N m] ŵ at rest, in the direction of positive motion
    drag: float = 0.0  # [N s/m] or [N m s/rad] of ŵ, per unit of reference velocity
    lasting: LastingValue = field(default_factory=LastingValue)  # [N] or [N m] at rest
    _velocity: float | None = None  # at the end of the last step; None: not known

    def expected(self, reference: float) -> float:
        """ŵ [N] or [N m] at this reference velocity."""
        return clamped(self.estimate + self.drag * reference, self.most(reference))

    def most(self, reference: float) -> float:
        """[N] or [N m] Largest estimate at this reference velocity."""
        return self.limit + self.drag_doubt * abs(self.plant.drag(reference))

    def learn(
        self,
        velocity: float,
        force: float,
        dt: float,
        most: float = inf,
        reference: float = 0.0,
        short: float = 0.0,
    ) -> None:
        """Take in one step.

        A force beyond the limit, as in a collision, counts as the limit.

        Args:
            velocity: measured now, relative to the water, [m/s] or [rad/s].
            force: mean thruster force since the last call, [N] or [N m].
            dt: [s] since the last call.
            most: [N] or [N m] largest change of the estimate.
            reference: reference velocity in this time, same units as the measured one.
            short: the effort that was asked for and could not be had, [N] or [N m]: nothing is
                learnt that would ask for more of it.
        """
        before, self._velocity = self._velocity, velocity
        if before is None or dt <= 0.0:
            return
        plant, middle = self.plant, (before + velocity) / 2
        inertia = plant.sampled_inertia(dt) * (velocity - before) / dt
        drag = plant.linear * before + plant.quadratic * middle * abs(middle)
        observed = clamped(inertia + drag - force, self.most(reference))
        change = -expm1(-self.bandwidth * dt) * (observed - self.expected(reference))
        asks_for_more = change * short < 0.0  # what is learnt is compensated by the opposite
        change = 0.0 if asks_for_more else clamped(change, most)
        if reference == 0.0:
            self.drag *= exp(-dt / DRAG_DECAY)
            self.estimate += change
            self.lasting.add(self.estimate, dt)
        else:
            size = reference / self.drag_speed
            self.drag += change / self.drag_speed * size / (1.0 + size * size)
            self.estimate += change / (1.0 + size * size)
            self.lasting.move()

    def is_limited(self, reference: float) -> bool:
        """Whether the estimate is at its limit for this reference velocity."""
        return abs(self.expected(reference)) > NEARLY * self.most(reference)

    def recall(self) -> None:
        """Back to the trusted estimate: what was learnt last may be of a wrong velocity, or one
        that was late."""
        self.pause()
        self.estimate, self.drag = self.lasting.trusted, 0.0

    def integrate(self, effort: float) -> None:
        """Learn without a velocity: `effort` [N] or [N m] more is needed."""
        self.estimate = clamped(self.estimate - effort, self.limit)

    def pause(self) -> None:
        """Skip a step; the estimate stays."""
        self._velocity = None

    def forget(self) -> None:
        """Reset the estimate."""
        self.pause()
        self.estimate = self.drag = 0.0
        self.lasting.forget()


def clamped(value: float, most: float) -> float:
    return max(-most, min(most, value))
