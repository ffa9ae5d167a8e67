"""A mirror-symmetric turn between two lines: zero curvature at both ends, largest in the middle.

Frame of a turn: it begins at the origin along +x and turns to the right, towards +y.
"""

from dataclasses import dataclass
from functools import cached_property
from math import cos, isfinite, pi, sin, tan
from typing import ClassVar, NamedTuple

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


# Gauss-Legendre quadrature with 20 nodes on −1 … 1, those above 0 and their weights, as NumPy gives
# them: 1e-15 of the length for turns up to π.
_UPPER = (
    (0.07652652113349734, 0.15275338713072628),
    (0.22778585114164507, 0.14917298647260424),
    (0.37370608871541955, 0.1420961093183824),
    (0.5108670019508271, 0.1316886384491769),
    (0.636053680726515, 0.1181945319615186),
    (0.7463319064601508, 0.1019301198172407),
    (0.8391169718222188, 0.08327674157670471),
    (0.912234428251326, 0.06267204833410879),
    (0.9639719272779138, 0.040601429800386446),
    (0.993128599185095, 0.017614007139150893),
)
_NODES = [*((-x, weight) for x, weight in reversed(_UPPER)), *_UPPER]
GAUSS = [((1 + x) / 2, weight / 2) for x, weight in _NODES]  # on 0 … 1


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
