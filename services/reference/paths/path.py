"""Paths of straight lines and symmetric turns through, or near, way-points, and the reference of a
vehicle that points along its course.

Source: Fernandes et al. 2015, section 3, (80) to (83) and (118) to (126). There, the speed along
the path is multiplied by the sign of the distance, which makes it 0 for one sample at the start of
a part; here it is the speed of the profile. The heading is the path's course, which has no jumps,
so it need not be accumulated. `s` is the distance along the path in the horizontal
plane: surge and yaw follow the plane curve (81), depth is a separate axis. The half-open intervals
of (97) to (99) and (125) leave the end of a part without a value; here every part includes its end.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import cos, isfinite, sin
from typing import Literal, NamedTuple, Self

from services.marine.attitude import wrapped
from services.marine.summation import plain_sum
from services.reference.paths.outline import (
    ROUNDING,
    Outline,
    TurnOf,
    ahead,
    approximating,
    checked,
    distance,
    interpolating,
)
from services.reference.paths.turn import STRAIGHT, SmoothTurn, Turn
from services.reference.trajectory.minimum_jerk import Sample

Kind = Literal["approximating", "interpolating"]


class PathPoint(NamedTuple):
    """A point of a path with its derivatives per metre of horizontal distance."""

    north: float  # [m]
    east: float  # [m]
    down: float  # [m]
    course: float  # [rad] from north towards east, without jumps along the path
    curvature: float  # [1/m] positive when turning to the right
    curvature_rate: float  # [1/m²]
    slope: float  # [-] of the depth: metres down per metre along
    slope_rate: float  # [1/m]


class Part(NamedTuple):
    """One line or one turn."""

    kind: str  # line, or the name of the turn's shape
    begin: float  # [m] along the path
    north: float  # [m] where it begins
    east: float  # [m]
    course: float  # [rad] with which it begins
    length: float  # [m]
    turn: Turn | None = None
    side: float = 1.0  # 1 turns right, -1 left

    def at(self, s: float) -> PathPoint:
        """The point `s` [m] from the start of the part; depth is not known here and 0."""
        if self.turn is None:
            x, y, course, curvature, rate = s, 0.0, 0.0, 0.0, 0.0
        else:
            x, y, course, curvature, rate = self.turn.at(s)
        y, ahead, aside = self.side * y, cos(self.course), sin(self.course)
        return PathPoint(
            self.north + x * ahead - y * aside,
            self.east + x * aside + y * ahead,
            0.0,
            self.course + self.side * course,
            self.side * curvature,
            self.side * rate,
            0.0,
            0.0,
        )


@dataclass(frozen=True)
class Path:
    """A plane curve with continuous curvature, and a depth along it whose slope and slope rate
    are continuous. Evaluated in O(log parts)."""

    parts: tuple[Part, ...]
    passes: tuple[float, ...]  # [m] along the path, where it passes each way-point
    depths: tuple[float, ...]  # [m] at those places

    @classmethod
    def through(
        cls,
        waypoints: Sequence[Sequence[float]],
        min_radius: float,
        kind: Kind = "approximating",
        shape: Callable[[float, float], Turn] = SmoothTurn,
    ) -> Self:
        """The path given by way-points `[north, east]` or `[north, east, down]` [m].

        Approximating paths cut the corners and pass only the first and last way-point;
        interpolating ones pass all. `outline.py` has a drawing.

        Args:
            min_radius: [m] > 0, in the middle of every turn.
            shape: of the turns, from their angle [rad] and their smallest radius [m].

        Raises:
            ValueError: an invalid way-point or radius, or a leg too short for its turns; names it,
                with what was found and what is needed.
        """
        points = checked(waypoints)

        def turn_of(angle: float) -> Turn:
            return shape(angle, min_radius)

        turn_of(1.0)  # refuses a bad radius even if there is no turn
        if kind not in ("approximating", "interpolating"):
            raise ValueError(f"kind: found {kind!r}, must be 'approximating' or 'interpolating'")
        outline_of = approximating if kind == "approximating" else interpolating
        parts, passes = _lay(outline_of(points, turn_of), turn_of)
        return cls(tuple(parts), tuple(passes), tuple(point.down for point in points))

    @cached_property
    def length(self) -> float:
        """[m] In the horizontal plane; (118)."""
        return self.parts[-1].begin + self.parts[-1].length

    @property
    def max_curvature(self) -> float:
        """[1/m] The greatest size of the curvature; 0 for a path without a turn."""
        return max(1 / part.turn.min_radius if part.turn else 0.0 for part in self.parts)

    def at(self, s: float) -> PathPoint:
        """The path `s` [m] from its start; before 0 and after `length` its two ends.

        Raises:
            ValueError: s is not finite.
        """
        if not isfinite(s):
            raise ValueError(f"s: found {s}, must be a finite number")
        s = max(0.0, min(self.length, s))
        part = self.parts[bisect_right(self._begins, s) - 1]
        down, slope, slope_rate = self._depth(s)
        here = part.at(min(s - part.begin, part.length))
        return here._replace(down=down, slope=slope, slope_rate=slope_rate)

    @cached_property
    def _begins(self) -> list[float]:
        return [part.begin for part in self.parts]

    def _depth(self, s: float) -> tuple[float, float, float]:
        """Depth, slope and slope rate. From way-point to way-point a minimum-jerk blend,
        10u³ − 15u⁴ + 6u⁵: level at each way-point (or in the middle of the turn that cuts it),
        at most 1.875 times as steep as the straight connection in between."""
        leg = min(bisect_right(self.passes, s), len(self.passes) - 1) - 1
        start, length = self.passes[leg], self.passes[leg + 1] - self.passes[leg]
        before, change = self.depths[leg], self.depths[leg + 1] - self.depths[leg]
        u = max(0.0, min(1.0, (s - start) / length))
        return (
            before + change * u**3 * (10 - 15 * u + 6 * u * u),
            change / length * 30 * (u * (1 - u)) ** 2,
            change / length**2 * 60 * u * (1 - u) * (1 - 2 * u),
        )


class RoutePoint(NamedTuple):
    """The reference at one instant. Body velocities are those of (82), body accelerations their
    derivatives (83): in a turn, sway stays 0 although the vehicle accelerates in NED."""

    t: float  # [s]
    s: float  # [m] along the path
    north: float  # [m]
    east: float  # [m]
    down: float  # [m]
    v_north: float  # [m/s]
    v_east: float  # [m/s]
    v_down: float  # [m/s]
    a_north: float  # [m/s²]
    a_east: float  # [m/s²]
    a_down: float  # [m/s²]
    heading: float  # [rad] accumulated, without jumps
    yaw_rate: float  # [rad/s]
    yaw_acceleration: float  # [rad/s²]
    surge_velocity: float  # [m/s]
    surge_acceleration: float  # [m/s²]
    sway_velocity: float  # [m/s]
    sway_acceleration: float  # [m/s²]
    curvature: float  # [1/m] positive when turning to the right


def point_on(path: Path, along: Sample, t: float) -> RoutePoint:
    """The reference of a vehicle whose motion along a path is `along` [m, m/s, m/s²] at `t` [s]."""
    s, v, a, _ = along
    here = path.at(s)
    ahead, aside = cos(here.course), sin(here.course)
    inwards = here.curvature * v * v
    return RoutePoint(
        t=t,
        s=max(0.0, min(path.length, s)),
        north=here.north,
        east=here.east,
        down=here.down,
        v_north=v * ahead,
        v_east=v * aside,
        v_down=v * here.slope,
        a_north=a * ahead - inwards * aside,
        a_east=a * aside + inwards * ahead,
        a_down=a * here.slope + v * v * here.slope_rate,
        heading=here.course,
        yaw_rate=here.curvature * v,
        yaw_acceleration=here.curvature_rate * v * v + here.curvature * a,
        surge_velocity=v,
        surge_acceleration=a,
        sway_velocity=0.0,
        sway_acceleration=0.0,
        curvature=here.curvature,
    )


def _lay(outline: Outline, turn_of: TurnOf) -> tuple[list[Part], list[float]]:
    """Lines and turns along an outline, and the distances at which it passes the way-points."""
    corners, courses, knots = outline
    turns = [wrapped(after - before) for before, after in pairwise(courses)]
    bends = [turn_of(abs(turn)) if abs(turn) >= STRAIGHT else None for turn in turns]
    cut = [0.0, *(bend.tangent if bend else 0.0 for bend in bends), 0.0]
    spans = [(0.0, 0.0)]  # [m] where the turn at each corner begins and ends
    parts: list[Part] = []
    s, heading = 0.0, courses[0]
    for i, (a, b) in enumerate(pairwise(corners)):
        line = distance(a, b) - cut[i] - cut[i + 1]
        if line > ROUNDING:
            parts.append(Part("line", s, *ahead(a, heading, cut[i])[:2], heading, line))
            s += line
        bend = bends[i] if i < len(bends) else None
        if bend is not None:
            start = ahead(b, heading, -cut[i + 1])[:2]
            side = 1.0 if turns[i] > 0 else -1.0
            parts.append(Part(bend.name, s, *start, heading, bend.length, bend, side))
        spans.append((s, s := s + bend.length if bend else s))
        heading += turns[i] if i < len(turns) else 0.0
    passes = [
        plain_sum(spans[corner]) / 2 if beyond is None else spans[corner][1] + beyond - cut[corner]
        for corner, beyond in knots
    ]
    return parts, passes
