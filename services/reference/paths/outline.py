"""The way-points of a path, and its outline: straight edges that meet in corners, later cut by
the turns.

An approximating path has its way-points as corners and passes inside them:

            corner = way-point
               +
          . - '  ' - .
       . '             ' .

An interpolating path passes through every way-point W with zero curvature. The turn towards the
next leg has two parts, one before and one after, so each leg is turn, line, turn:

          A           B              A and B are corners; the distances W1-A and B-W2 are the
       .-' ' - . . - ' '-.           tangents of their turns, and the line between the turns
     W1                   W2         lies on A-B

The course at each way-point determines the shape. Two rules, the first where there is room:

1. Lane changes (Fernandes et al. 2015, figure 5). A leg that turns one way at its start and the
   other way at its end, by less than 90° each, is a lane change, and its neighbours are the lanes:
   its two way-points are passed on the courses of the lanes, which are followed exactly. The paper
   uses one antisymmetric pair of clothoids, whose curvature jumps in the middle; two symmetric
   pairs with a line between do not jump, and are shorter.
2. Everywhere else the course bisects the corner. If a lane change or a later leg lacks room, this
   applies to all way-points.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import atan2, cos, hypot, inf, pi, sin
from typing import NamedTuple

from services.marine.attitude import wrapped
from services.reference.paths.turn import STRAIGHT, Turn

TurnOf = Callable[[float], Turn]  # from the angle [rad]
LEAST_CORNER = 1e-6  # [rad] a smaller corner does not make a lane change
ROUNDING = 1e-9  # [m] tolerance of a leg that is too short
APART = 1e-6  # [m] way-points closer than this count as the same
FARTHEST = 1e6  # [m] from the origin and from each other; limited by rounding


class Waypoint(NamedTuple):
    """A point that defines the path."""

    north: float  # [m]
    east: float  # [m]
    down: float = 0.0  # [m]


def checked(waypoints: Sequence[Sequence[float]]) -> list[Waypoint]:
    """Validate way-points `[north, east]` or `[north, east, down]` [m].

    Raises:
        ValueError: says which way-point, what was found and what is allowed.
    """
    if len(waypoints) < 2:
        raise ValueError(f"waypoints: a path needs at least 2 way-points, found {len(waypoints)}")
    points: list[Waypoint] = []
    for number, values in enumerate(waypoints, 1):
        if len(values) not in (2, 3) or len(values) != len(waypoints[0]):
            raise ValueError(
                f"way-point {number}: found {len(values)} numbers, must be"
                " [north, east] everywhere or [north, east, down] everywhere"
            )
        if not all(abs(value) <= FARTHEST for value in values):
            raise ValueError(
                f"way-point {number}: found {list(values)}, must be finite numbers"
                f" within ±{FARTHEST:g} m"
            )
        points.append(Waypoint(*map(float, values)))
    for number, (a, b) in enumerate(pairwise(points), 1):
        if not APART <= distance(a, b) <= FARTHEST:
            raise ValueError(
                f"way-points {number} and {number + 1} are {distance(a, b):g} m apart in the"
                f" horizontal plane, must be {APART:g} m to {FARTHEST:g} m"
            )
    courses = [course(a, b) for a, b in pairwise(points)]
    for number, (before, after) in enumerate(pairwise(courses), 2):
        if abs(wrapped(after - before)) > pi - STRAIGHT:
            raise ValueError(
                f"way-point {number}: the path goes exactly back there; a turn needs a corner of"
                " less than 180°, so add a way-point beside it"
            )
    return points


def distance(a: Waypoint, b: Waypoint) -> float:
    """[m] In the horizontal plane."""
    return hypot(b.north - a.north, b.east - a.east)


def course(a: Waypoint, b: Waypoint) -> float:
    """[rad] From `a` to `b`, from north towards east; (88)."""
    return atan2(b.east - a.east, b.north - a.north)


class Knot(NamedTuple):
    """Position of a way-point: on an edge, or in the middle of the turn at its corner."""

    corner: int
    beyond: float | None  # [m] along the edge from this corner; None: in the middle of its turn


class Outline(NamedTuple):
    """Corners (the first and last are the ends) and the course of the edge after each."""

    corners: list[Waypoint]
    courses: list[float]  # [rad], one fewer than corners
    knots: list[Knot]  # one per way-point


def approximating(points: Sequence[Waypoint], turn_of: TurnOf) -> Outline:
    """
    Raises:
        ValueError: a leg is too short for its turns.
    """
    courses = [course(a, b) for a, b in pairwise(points)]
    turns = [wrapped(after - before) for before, after in pairwise(courses)]
    tangents = [0.0, *(tangent(turn, turn_of) for turn in turns), 0.0]
    for number, (a, b) in enumerate(pairwise(points)):
        need = tangents[number] + tangents[number + 1]
        if distance(a, b) < need - ROUNDING:
            raise _too_short(number, distance(a, b), need)
    return Outline(list(points), courses, [Knot(i, None) for i in range(len(points))])


def interpolating(points: Sequence[Waypoint], turn_of: TurnOf) -> Outline:
    """
    Raises:
        ValueError: a leg is too short for its turns.
    """
    legs = [course(a, b) for a, b in pairwise(points)]
    bisecting = _bisecting(legs)
    try:
        return _through(points, _changing_lanes(legs, bisecting), turn_of)
    except ValueError:
        return _through(points, bisecting, turn_of)


def tangent(angle: float, turn_of: TurnOf) -> float:
    """[m] From the start of a turn of either sign to its corner; inf for one of 180°."""
    angle = wrapped(angle)
    if abs(angle) < STRAIGHT:
        return 0.0
    return inf if abs(angle) > pi - STRAIGHT else turn_of(abs(angle)).tangent


def _bisecting(legs: Sequence[float]) -> list[float | None]:
    """The course at every way-point; None: free, at the ends."""
    inner = [before + wrapped(after - before) / 2 for before, after in pairwise(legs)]
    return [None, *inner, None]


def _changing_lanes(legs: Sequence[float], bisecting: Sequence[float | None]) -> list[float | None]:
    turns = [wrapped(after - before) for before, after in pairwise(legs)]
    changes = [False, *(_is_lane_change(*pair) for pair in pairwise(turns)), False]  # per leg
    courses = list(bisecting)
    for leg in range(1, len(legs) - 1):
        if changes[leg] and not changes[leg - 1] and not changes[leg + 1]:
            courses[leg], courses[leg + 1] = legs[leg - 1], legs[leg + 1]
    return courses


def _is_lane_change(first: float, second: float) -> bool:
    return first * second < 0 and all(LEAST_CORNER < abs(turn) < pi / 2 for turn in (first, second))


def _through(points: Sequence[Waypoint], at: Sequence[float | None], turn_of: TurnOf) -> Outline:
    """Corners and edges of the path through `points` with the courses `at`."""
    outline = Outline([points[0]], [], [Knot(0, 0.0)])
    for number, (a, b) in enumerate(pairwise(points)):
        leg = _Leg(distance(a, b), course(a, b), at[number], at[number + 1], turn_of)
        line = leg.line()
        if line is None:
            raise _too_short(number, leg.length, leg.need())
        outline.courses.append(line)
        if leg.start is not None:
            reach = tangent(line - leg.start, turn_of)
            outline.corners.append(ahead(a, leg.start, reach))
        if leg.end is not None:
            reach = tangent(leg.end - line, turn_of)
            outline.corners.append(ahead(b, leg.end, -reach))
            outline.courses.append(leg.end)
            outline.knots.append(Knot(len(outline.corners) - 1, reach))
    outline.corners.append(points[-1])
    last = outline.corners[-2]
    outline.knots.append(Knot(len(outline.corners) - 2, distance(last, points[-1])))
    return outline


class _Leg(NamedTuple):
    """Turn, line, turn from one way-point to the next."""

    length: float  # [m] between the way-points
    course: float  # [rad] from one to the other
    start: float | None  # [rad] course at the first way-point; None: free
    end: float | None  # [rad] course at the second
    turn_of: TurnOf

    def line(self) -> float | None:
        """Course of the line [rad]; None when there is no room."""
        here, step = self.course, self._offset(self.course) / self.length
        offset = step * self.length
        for _ in range(60):  # secant; from the leg's course the root is approached from one side
            before, here = here, here + max(-0.3, min(0.3, step))
            last, offset = offset, self._offset(here)
            if abs(here - before) < 1e-16 or offset in (0.0, last):
                break
            step = -offset * (here - before) / (offset - last)
        return here if self._fits(here) else None

    def need(self) -> float:
        """[m] The shortest leg with this course that has room for its turns."""
        low, high = self.length, self.length
        while self._replace(length=high).line() is None:
            low, high = high, 2 * high
        while high - low > 1e-4 * high:
            middle = (low + high) / 2
            if self._replace(length=middle).line() is None:
                low = middle
            else:
                high = middle
        return high

    def _turns(self, line: float) -> tuple[float, float]:
        """[rad] The first and the second turn, positive to the right."""
        return (
            0.0 if self.start is None else wrapped(line - self.start),
            0.0 if self.end is None else wrapped(self.end - line),
        )

    def _offset(self, line: float) -> float:
        """[m] Offset of corner B to the right of the line from corner A."""
        first, second = self._turns(line)
        turned = _swing(first, self.turn_of) - _swing(second, self.turn_of)
        return self.length * sin(self.course - line) + turned

    def _fits(self, line: float) -> bool:
        first, second = self._turns(line)
        a, b = tangent(first, self.turn_of), tangent(second, self.turn_of)
        if max(a, b) == inf or abs(self._offset(line)) > ROUNDING * max(1.0, self.length / 1e3):
            return False
        between = self.length * cos(self.course - line) - a * cos(first) - b * cos(second)
        return between >= a + b - ROUNDING


def _swing(angle: float, turn_of: TurnOf) -> float:
    """[m] Tangent times sine of a turn, finite even for one of 180°."""
    if abs(angle) < STRAIGHT:
        return 0.0
    size = turn_of(abs(angle)).swing
    return size if angle > 0 else -size


def ahead(point: Waypoint, heading: float, by: float) -> Waypoint:
    """`by` [m] further, on this course [rad]."""
    return point._replace(
        north=point.north + by * cos(heading), east=point.east + by * sin(heading)
    )


def _too_short(leg: int, length: float, need: float) -> ValueError:
    return ValueError(
        f"leg {leg + 1} (way-point {leg + 1} to {leg + 2}) is {length:.6g} m long, its turns need"
        f" {need:.6g} m; a smaller min_radius or a longer leg has room"
    )
