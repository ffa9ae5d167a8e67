"""A disturbance observer: the external force, estimated from motion that the thrusters do not
explain.

For M v' = u - D(v) + w it is the first-order filter ŵ' = ω (w - ŵ), which needs no derivative of
the velocity when written with z = ŵ - ω M v:

    z' = -ω z - ω (ω M v + u - D(v)),   ŵ = z + ω M v.

Here it is discretised exactly: the estimate moves by the share 1 - exp(-ω dt) towards the force w
that explains the last step of the sampled plant (see `Plant.sampled_inertia`). A constant
disturbance is estimated without error, and its compensation replaces an integrator.

In surge, a drone has more drag in heave and yaw than at rest, and that extra force vanishes when
heave or yaw stop. So what is learnt during motion is split into a drag proportional to the
reference velocity and a constant (normalised least mean squares, regressors 1 and v / v₀). Without
motion the drag decays, because the next motion may have another surge speed.
"""

from dataclasses import dataclass, field
from math import exp, expm1, inf

from services.control.axis.lasting_value import LastingValue
from services.control.axis.plant import Plant

NEARLY = 0.99  # [-] of the limit, which the estimate only approaches
DRAG_DECAY = 1.0  # [s] time constant of the drag without motion


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
        self._change(0.0 if asks_for_more else clamped(change, most), reference, dt)
        if reference == 0.0:
            self.lasting.add(self.estimate, dt)
        else:
            self.lasting.move()

    def _change(self, change: float, reference: float, dt: float) -> None:
        if reference == 0.0:
            self.drag *= exp(-dt / DRAG_DECAY)
            self.estimate += change
            return
        size = reference / self.drag_speed
        self.drag += change / self.drag_speed * size / (1.0 + size * size)
        self.estimate += change / (1.0 + size * size)

    def is_limited(self, reference: float) -> bool:
        """Whether the estimate is at its limit for this reference velocity."""
        return abs(self.expected(reference)) > NEARLY * self.most(reference)

    def recall(self) -> None:
        """Back to the trusted estimate: what was learnt last may be of a wrong velocity."""
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
