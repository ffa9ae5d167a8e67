"""The way-points of a path: validation, distances and courses."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, hypot, pi
from typing import NamedTuple

from services.marine.attitude import wrapped
from services.reference.paths.turn import STRAIGHT

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
    _require_no_reversal(points)
    return points


def distance(a: Waypoint, b: Waypoint) -> float:
    """[m] In the horizontal plane."""
    return hypot(b.north - a.north, b.east - a.east)


def course(a: Waypoint, b: Waypoint) -> float:
    """[rad] From `a` to `b`, from north towards east; (88)."""
    return atan2(b.east - a.east, b.north - a.north)


def _require_no_reversal(points: Sequence[Waypoint]) -> None:
    courses = [course(a, b) for a, b in pairwise(points)]
    for number, (before, after) in enumerate(pairwise(courses), 2):
        if abs(wrapped(after - before)) > pi - STRAIGHT:
            raise ValueError(
                f"way-point {number}: the path goes exactly back there; a turn needs a corner of"
                " less than 180°, so add a way-point beside it"
            )
