"""Velocity changes of two axes together, along a straight line in velocity space.

Planned axis by axis, a change of surge and sway curves, because the smaller one ends first. Here
the limits apply to the norms of jerk and acceleration, whatever the frame's orientation.

The scalar law follows the line from the present velocity to the target. An acceleration across that
line is brought to zero, and what it has gained is undone, by the same law at the same time; then
each of the two gets the limits divided by √2, so that their norms keep them. An acceleration above
the limit falls, and its norm never rises.

This law is ours: the vector form of Andrén 2023, 7.2.4, has the faults of his scalar rule (3.9 J).
"""

from dataclasses import dataclass, field
from math import hypot, sqrt

from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample

Pair = tuple[float, float]
STILL: Pair = (0.0, 0.0)
ROUNDING = 1e-9  # [-] of the acceleration that a change takes; less across its line counts as none


@dataclass(slots=True)
class VectorRamp:
    """A velocity vector that moves to a target, with its position: `Ramp` for two axes. Any
    position unit; time is the caller's, in seconds, and never decreases."""

    limits: Limits  # of the norms
    target: Pair = field(default=STILL, init=False)
    _line: Pair = field(default=(1.0, 0.0), init=False)  # direction of the newest change
    _along: Ramp = field(init=False)
    _across: Ramp = field(init=False)

    def __post_init__(self) -> None:
        self._along, self._across = Ramp(self.limits), Ramp(self.limits)
        self.rest(0.0)

    def at(self, t: float) -> tuple[Sample, Sample]:
        """The reference of each axis at `t` [s] ≥ the last change of target."""
        (c, s), along, across = self._line, self._along.at(t), self._across.at(t)
        pairs = tuple(zip(along, across, strict=True))
        first = Sample(*[c * p - s * q for p, q in pairs])
        second = Sample(*[s * p + c * q for p, q in pairs])
        if t < self.settles():
            return first, second
        v, w = self.target  # without the rounding of turning it
        return Sample(first.position, v, 0.0, 0.0), Sample(second.position, w, 0.0, 0.0)

    def aim(self, target: Pair, t: float, limits: Limits | None = None) -> None:
        """From `t` [s] on, go to velocity `target`, within other limits if given. Without limits,
        no effect if that is the target already."""
        if target != self.target or limits is not None:
            self._begin(*self.at(t), target, t, limits or self.limits)

    def take(self, first: Sample, second: Sample, t: float) -> None:
        """Continue from another generator's reference at `t` [s], and come to rest."""
        self._begin(first, second, STILL, t, self.limits)

    def rest(self, t: float) -> None:
        """Rest at zero from `t` [s] on; discards the plan."""
        self.take(Sample(0.0, 0.0, 0.0, 0.0), Sample(0.0, 0.0, 0.0, 0.0), t)

    def settles(self) -> float:
        """[s] When the target velocity is reached."""
        return max(self._along.settles(), self._across.settles())

    def _begin(self, first: Sample, second: Sample, target: Pair, t: float, limits: Limits) -> None:
        change = target[0] - first.velocity, target[1] - second.velocity
        size = hypot(*change)
        norm = hypot(first.acceleration, second.acceleration)
        if size > 0.0:
            self._line = change[0] / size, change[1] / size
        elif norm > 0.0:
            self._line = first.acceleration / norm, second.acceleration / norm
        c, s = self._line
        pairs = tuple(zip(first, second, strict=True))
        along = Sample(*[c * x + s * y for x, y in pairs])
        across = Sample(*[c * y - s * x for x, y in pairs])
        to, beside = c * target[0] + s * target[1], c * target[1] - s * target[0]
        across = across._replace(velocity=beside)  # it is, but for rounding
        if abs(across.acceleration) <= ROUNDING * (norm + sqrt(limits.jerk * size)):
            across = across._replace(acceleration=0.0)
        else:
            limits = Limits(limits.jerk / sqrt(2.0), limits.acceleration / sqrt(2.0))
        self.target = target
        self._along.take(along, t, to, limits)
        self._across.take(across, t, beside, limits)
