"""A mirror-symmetric turn between two lines: zero curvature at both ends, largest in the middle.

Frame of a turn: it begins at the origin along +x and turns to the right, towards +y.
"""

from dataclasses import dataclass
from functools import cached_property
from math import cos, isfinite, pi, sin, tan
from typing import ClassVar, NamedTuple

import numpy as np

from services.marine.summation import plain_sum

STRAIGHT = 1e-9  # [rad] a smaller corner is no turn; a corner this close to π is a reversal


class TurnPoint(NamedTuple):
    """A point of a turn with course and curvature."""

    x: float  # [m]
    y: float  # [m]
    course: float  # [rad] from +x towards +y
    curvature: float  # [1/m] ≥ 0
    curvature_rate: float  # [1/m²] per metre along the curve


@dataclass(frozen=True)
class Turn:
    """The common base of all turn shapes; a shape provides `first_half`.

    Raises:
        ValueError: the radius is not positive or the angle is not between 0 and half a circle.
    """

    angle: float  # [rad] change of course
    min_radius: float  # [m] in the middle
    name: ClassVar[str] = "turn"  # of the shape

    def __post_init__(self) -> None:
        if not (isfinite(self.min_radius) and self.min_radius > 0):
            raise ValueError(
                f"min_radius: found {self.min_radius} m, must be a finite number more than 0"
            )
        if not 0 < self.angle <= pi:
            raise ValueError(f"turn angle: found {self.angle} rad, must be more than 0, at most π")

    def first_half(self, s: float) -> TurnPoint:
        """`s` [m] from the start, 0 … half the length."""
        raise NotImplementedError

    @property
    def length(self) -> float:
        """[m] (96): the mean curvature of every shape is half the largest."""
        return 2 * self.angle * self.min_radius

    @cached_property
    def middle(self) -> TurnPoint:
        """The point of largest curvature."""
        return self.first_half(self.length / 2)

    @cached_property
    def tangent(self) -> float:
        """[m] From the start to the corner, and from there to the end.

        Raises:
            ValueError: a turn of 180°, whose two tangents never meet.
        """
        if self.angle > pi - STRAIGHT:
            raise ValueError("a turn of 180° has no corner: the way on is parallel to the way back")
        return self.middle.x + self.middle.y * tan(self.angle / 2)

    @cached_property
    def swing(self) -> float:
        """[m] Tangent times the sine of the angle, finite even at 180°."""
        return self.middle.x * sin(self.angle) + 2 * self.middle.y * sin(self.angle / 2) ** 2

    def at(self, s: float) -> TurnPoint:
        """`s` [m] from the start, 0 … length. The second half is the first, mirrored; replaces
        (104) to (109)."""
        if s <= self.length / 2:
            return self.first_half(s)
        ahead, aside = cos(self.angle), sin(self.angle)
        x, y = self.middle.x, self.middle.y
        back = self.first_half(self.length - s)
        return TurnPoint(
            x + (x - back.x) * ahead + (y - back.y) * aside,
            y + (x - back.x) * aside - (y - back.y) * ahead,
            self.angle - back.course,
            back.curvature,
            -back.curvature_rate,
        )


_nodes, _weights = np.polynomial.legendre.leggauss(20)  # 1e-15 of the length for turns up to π
GAUSS = [(float(1 + x) / 2, float(w) / 2) for x, w in zip(_nodes, _weights, strict=True)]


class SmoothTurn(Turn):
    """A turn whose curvature rises along a smooth step instead of a linear ramp.

    Along twin clothoids the curvature is continuous, but its rate jumps at the start, in the middle
    and at the end, and with it the yaw acceleration κ' v² + κ a: the yaw reference of Fernandes et
    al. 2015 is C1. Here κ(u) = (3u² − 2u³)/r over the first half, u = 0 … 1, mirrored in the
    second, so the rate is 0 at those three points and the yaw reference is C2. Turn angle, length
    and smallest radius are those of the twin clothoids; the largest curvature rate is 1.5 times
    theirs, and the turn cuts its corner slightly less, so it fits wherever theirs does.
    """

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
