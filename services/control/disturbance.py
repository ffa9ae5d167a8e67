"""A disturbance observer: the force the water adds, learnt from what the thrusters do not explain.

For M v' = u - D(v) + w it is the first-order filter ŵ' = ω (w - ŵ), which needs no derivative of
the velocity when written with z = ŵ - ω M v:

    z' = -ω z - ω (ω M v + u - D(v)),   ŵ = z + ω M v.

Here it is discretised exactly: the force w that explains the last step of the sampled plant (see
`Plant.sampled_inertia`) is taken in with the share 1 - exp(-ω dt). A constant disturbance is
learnt without error, and its subtraction takes the place of an integrator.
"""

from dataclasses import dataclass
from math import expm1, inf

from services.control.plant import Plant

NEARLY = 0.99  # [-] of the limit, which it only comes close to


@dataclass(slots=True)
class DisturbanceObserver:
    plant: Plant
    bandwidth: float  # [rad/s] ω
    limit: float  # [N] or [N m] it never believes in more than this
    estimate: float = 0.0  # [N] or [N m] ŵ, in the direction of positive motion
    _velocity: float | None = None  # at the end of the last step; None: not known

    def learn(self, velocity: float, force: float, dt: float, most: float = inf) -> None:
        """Take in one step.

        A step that would need more than the limit, as a collision does, counts as the limit.

        Args:
            velocity: measured now, relative to the water, [m/s] or [rad/s].
            force: mean of what the thrusters really did since the last call, [N] or [N m].
            dt: [s] since the last call.
            most: [N] or [N m] the estimate may change.
        """
        before, self._velocity = self._velocity, velocity
        if before is None or dt <= 0.0:
            return
        plant, middle = self.plant, (before + velocity) / 2
        inertia = plant.sampled_inertia(dt) * (velocity - before) / dt
        drag = plant.linear * before + plant.quadratic * middle * abs(middle)
        believed = clamped(inertia + drag - force, self.limit)
        change = -expm1(-self.bandwidth * dt) * (believed - self.estimate)
        self.estimate += clamped(change, most)

    @property
    def limited(self) -> bool:
        """There may be more than it believes in."""
        return abs(self.estimate) > NEARLY * self.limit

    def pause(self) -> None:
        """Keep what is learnt over a step that teaches nothing."""
        self._velocity = None

    def forget(self) -> None:
        self.pause()
        self.estimate = 0.0


def clamped(value: float, most: float) -> float:
    return max(-most, min(most, value))
