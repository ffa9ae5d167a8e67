"""A turn whose curvature rises along a smooth step instead of a linear ramp.

Along twin clothoids the curvature is continuous, but its rate jumps at the start, in the middle and
at the end, and with it the yaw acceleration κ' v² + κ a: the yaw reference of Fernandes et al.
2015 is C1. Here κ(u) = (3u² − 2u³)/r over the first half, u = 0 … 1, mirrored in the second, so
the rate is 0 at those three points and the yaw reference is C2. Turn angle, length and smallest
radius are those of the twin clothoids; the largest curvature rate is 1.5 times theirs, and the turn
cuts its corner slightly less, so it fits wherever theirs does.
"""

from math import cos, sin

import numpy as np

from services.marine.summation import plain_sum
from services.reference.paths.turn import Turn, TurnPoint

_nodes, _weights = np.polynomial.legendre.leggauss(20)  # 1e-15 of the length for turns up to π
GAUSS = [(float(1 + x) / 2, float(w) / 2) for x, w in zip(_nodes, _weights, strict=True)]


class SmoothTurn(Turn):
    """A turn with a C2 yaw reference."""

    name = "smooth turn"

    def first_half(self, s: float) -> TurnPoint:
        """The position is a quadrature with 20 nodes."""
        half = self.length / 2
        u = s / half
        courses = [(weight, self._course(u * node)) for node, weight in GAUSS]
        return TurnPoint(
            s * plain_sum(weight * cos(course) for weight, course in courses),
            s * plain_sum(weight * sin(course) for weight, course in courses),
            self._course(u),
            u * u * (3 - 2 * u) / self.min_radius,
            6 * u * (1 - u) / (half * self.min_radius),
        )

    def _course(self, u: float) -> float:
        return self.angle * u**3 * (1 - u / 2)
