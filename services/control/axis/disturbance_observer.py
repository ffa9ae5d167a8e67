"""A disturbance observer: the force the water adds, learnt from what the thrusters do not explain.

For M v' = u - D(v) + w it is the first-order filter ŵ' = ω (w - ŵ), which needs no derivative of
the velocity when written with z = ŵ - ω M v:

    z' = -ω z - ω (ω M v + u - D(v)),   ŵ = z + ω M v.

Here it is discretised exactly: the force w that explains the last step of the sampled plant (see
`Plant.sampled_inertia`) is taken in with the share 1 - exp(-ω dt). A constant disturbance is
learnt without error, and its subtraction takes the place of an integrator.

A drone that is flown ahead meets more drag in heave and yaw than one at rest, and all of that is
gone once heave or yaw stop. So what is learnt during motion counts as a drag in proportion to the
speed asked for, and only the rest as a constant (normalised least mean squares, regressors 1 and
v / v₀). Without motion the drag is forgotten again: nobody knows how fast the next one will be.
"""

from dataclasses import dataclass
from math import exp, expm1, inf

from services.control.axis.plant import Plant

NEARLY = 0.99  # [-] of the limit, which it only comes close to
DRAG_MEMORY = 1.0  # [s] for which the drag is remembered without motion


@dataclass(slots=True)
class DisturbanceObserver:
    plant: Plant
    bandwidth: float  # [rad/s] ω
    limit: float  # [N] or [N m] it never believes in more than this
    drag_speed: float = inf  # [m/s] or [rad/s] v₀; much slower, all counts as constant
    estimate: float = 0.0  # [N] or [N m] ŵ at rest, in the direction of positive motion
    drag: float = 0.0  # [N s/m] or [N m s/rad] of ŵ for each unit of speed asked for
    _velocity: float | None = None  # at the end of the last step; None: not known

    def expected(self, asked: float) -> float:
        """ŵ [N] or [N m] for the velocity asked for."""
        return clamped(self.estimate + self.drag * asked, self.limit)

    def learn(
        self, velocity: float, force: float, dt: float, most: float = inf, asked: float = 0.0
    ) -> None:
        """Take in one step.

        A step that would need more than the limit, as a collision does, counts as the limit.

        Args:
            velocity: measured now, relative to the water, [m/s] or [rad/s].
            force: mean of what the thrusters really did since the last call, [N] or [N m].
            dt: [s] since the last call.
            most: [N] or [N m] the estimate may change.
            asked: velocity that the reference had in this time, same units as the measured one.
        """
        before, self._velocity = self._velocity, velocity
        if before is None or dt <= 0.0:
            return
        plant, middle = self.plant, (before + velocity) / 2
        inertia = plant.sampled_inertia(dt) * (velocity - before) / dt
        drag = plant.linear * before + plant.quadratic * middle * abs(middle)
        believed = clamped(inertia + drag - force, self.limit)
        change = -expm1(-self.bandwidth * dt) * (believed - self.expected(asked))
        self._change(clamped(change, most), asked, dt)

    def _change(self, change: float, asked: float, dt: float) -> None:
        if asked == 0.0:
            self.drag *= exp(-dt / DRAG_MEMORY)
            self.estimate += change
            return
        size = asked / self.drag_speed
        self.drag += change / self.drag_speed * size / (1.0 + size * size)
        self.estimate += change / (1.0 + size * size)

    def is_limited(self, asked: float) -> bool:
        """At this velocity asked for there may be more than it believes in."""
        return abs(self.expected(asked)) > NEARLY * self.limit

    def pause(self) -> None:
        """Keep what is learnt over a step that teaches nothing."""
        self._velocity = None

    def forget(self) -> None:
        self.pause()
        self.estimate = self.drag = 0.0


def clamped(value: float, most: float) -> float:
    return max(-most, min(most, value))
