"""A mirror-symmetric turn between two lines: zero curvature at both ends, largest in the middle.

Frame of a turn: it begins at the origin along +x and turns to the right, towards +y.
"""

from dataclasses import dataclass
from functools import cached_property
from math import cos, isfinite, pi, sin, tan
from typing import ClassVar, NamedTuple

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
