"""A whole path with the speed along it, planned before it is driven: for `lindy path` and the
papers. On board a path is followed from rest to rest at one speed (services/reference/guidance).

Its turns may be twin clothoids, along each of which the curvature changes linearly with the
distance. Source: Fernandes et al. 2015, section 3.3, in closed form: the power series (101), (102)
are Fresnel integrals.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, isclose, pi, sin, sqrt
from typing import Protocol

from services.reference.paths.path import Path, PathPoint, RoutePoint, point_on
from services.reference.paths.turn import Turn, TurnPoint
from services.reference.trajectory.minimum_jerk import (
    Limits,
    MotionProfile,
    PositionMove,
    Sample,
    pair,
    solve,
    travelled,
)

SMALLEST = 1e-17  # relative; smaller terms of a series change nothing


def fresnel(z: float) -> tuple[float, float]:
    """C(z), S(z): the integrals of cos(π t²/2) and sin(π t²/2) from 0 to z.

    Power series, to 1e-15 for |z| ≤ 1.5 (a turn needs |z| ≤ 1).

    Raises:
        ValueError: |z| > 1.5, where the series loses digits.
    """
    if not abs(z) <= 1.5:
        raise ValueError(f"z: found {z}, the series is good for -1.5 to 1.5")
    square = pi * z * z / 2
    c = s = 0.0
    power, n = z, 0  # z (π z²/2)ⁿ / n!: even n belong to C, odd n to S
    while abs(power) > SMALLEST * abs(z):
        term = power / (2 * n + 1) * (1 if n % 4 < 2 else -1)
        c, s = (c + term, s) if n % 2 == 0 else (c, s + term)
        n += 1
        power *= square / n
    return c, s


class TwinClothoids(Turn):
    """The turn of Fernandes et al. 2015, even parity: the curvature rises linearly to 1/r in the
    middle and falls linearly back to 0."""

    name = "clothoids"

    def first_half(self, s: float) -> TurnPoint:
        half = self.length / 2
        u, scale = s / half, sqrt(pi / self.angle)
        c, integral_s = fresnel(u / scale)
        return TurnPoint(
            half * scale * c,
            half * scale * integral_s,
            self.angle * u * u / 2,
            u / self.min_radius,
            1 / (self.min_radius * half),
        )


ARRIVED = 1e-6  # [m] the profile may miss the end of the path by this much, [m/s] be this fast
STEP = 0.1  # [m] between the points of two paths that are compared


@dataclass(frozen=True)
class Route:
    """
    Raises:
        ValueError: the profile does not end at rest at the end of the path.
    """

    path: Path
    profile: MotionProfile  # distance along the path [m], from 0 to its length

    def __post_init__(self) -> None:
        end = self.profile.at(self.profile.duration)
        if not abs(end.position - self.path.length) <= ARRIVED or not abs(end.velocity) <= ARRIVED:
            raise ValueError(
                f"the speed profile ends after {end.position:.9g} m at {end.velocity:g} m/s, must"
                f" end at rest after {self.path.length:.9g} m, the length of the path"
            )

    @property
    def duration(self) -> float:
        """[s]"""
        return self.profile.duration

    def at(self, t: float) -> RoutePoint:
        """The reference at `t` [s]; before 0 as at the start, after the end at rest there."""
        return point_on(self.path, self.profile.at(max(0.0, t)), t)


class MotionLaw(Protocol):
    """A generator of the motion over a length, with its settings filled in."""

    def __call__(
        self, length: float, cruise: float, initial: float, final: float
    ) -> MotionProfile: ...


def route(path: Path, motion: MotionLaw, speeds: Sequence[float]) -> Route:
    """A path at given speeds, from rest to rest.

    Args:
        speeds: [m/s] > 0, one for the whole path, or one per part. Where two parts meet, the lower
            of their speeds applies, as in Table 3 of the paper.

    Raises:
        ValueError: wrong number of speeds, or a part is too short to change the speed; names it.
    """
    if len(speeds) == 1:
        return Route(path, motion(path.length, speeds[0], 0.0, 0.0))
    if len(speeds) != len(path.parts):
        raise ValueError(
            f"speeds: found {len(speeds)}, must be one, or one for each of the"
            f" {len(path.parts)} parts of this path"
        )
    meets = [0.0, *(min(a, b) for a, b in pairwise(speeds)), 0.0]
    profiles: list[MotionProfile] = []
    for i, (part, cruise) in enumerate(zip(path.parts, speeds, strict=True)):
        try:
            profiles.append(motion(part.length, cruise, meets[i], meets[i + 1]))
        except ValueError as error:
            raise ValueError(f"part {i + 1} ({part.kind}): {error}") from None
    return Route(path, sequence(profiles))


def stretch(
    distance: float, limits: Limits, cruise: float, initial: float = 0.0, final: float = 0.0
) -> PositionMove:
    """The fastest motion over `distance` > 0 between two speeds, with the law that is flown.

    Args:
        cruise: > 0, highest speed.
        initial, final: speeds at the ends, 0 to cruise, with zero acceleration there.

    Raises:
        ValueError: a speed is out of range, or the distance is too short for the change of speed.
    """
    if not (0 <= initial <= cruise and 0 <= final <= cruise and cruise > 0):
        raise ValueError(
            f"speeds: found {initial:g} to {final:g} at a cruise of {cruise:g}, must be 0 to cruise"
        )
    if (least := travelled(solve(initial, 0.0, final, limits))) > distance:
        raise ValueError(
            f"{distance:.6g} m are too short to get from {initial:g} to {final:g} m/s, which needs"
            f" {least:.6g} m with this jerk and acceleration"
        )
    return pair(distance, limits, cruise, initial, final=final)


@dataclass(frozen=True, slots=True)
class ProfileSequence:
    """A `MotionProfile` of consecutive parts; each starts where and when the previous one ends."""

    parts: tuple[MotionProfile, ...]
    begins: tuple[float, ...]  # [s] when each part starts, the first at 0
    starts: tuple[float, ...]  # position where each part starts, the first at 0
    duration: float  # [s] from the start of the first part to the arrival of the last

    def at(self, t: float) -> Sample:
        """Position from the start of the first part, velocity, acceleration, jerk at `t` [s]."""
        k = max(0, bisect_right(self.begins, t) - 1)
        here = self.parts[k].at(t - self.begins[k])
        return here._replace(position=self.starts[k] + here.position)


def sequence(parts: Sequence[MotionProfile]) -> ProfileSequence:
    """Chain motions.

    Raises:
        ValueError: no motions, or one starts with another velocity than the previous one ends with.
    """
    if not parts:
        raise ValueError("a sequence of motions is empty, expected at least one")
    begins, starts, time, position, velocity = [0.0], [0.0], 0.0, 0.0, parts[0].at(0.0).velocity
    for number, part in enumerate(parts, start=1):
        first, last = part.at(0.0), part.at(part.duration)
        if not isclose(first.velocity, velocity, rel_tol=1e-9, abs_tol=1e-12):
            raise ValueError(
                f"part {number} starts with velocity {first.velocity:g}, expected "
                f"{velocity:g}, with which part {number - 1} ends"
            )
        time, position, velocity = time + part.duration, position + last.position, last.velocity
        begins.append(time)
        starts.append(position)
    return ProfileSequence(tuple(parts), tuple(begins[:-1]), tuple(starts[:-1]), time)


def furthest(path: Path, other: Path) -> float:
    """[m] Largest distance of `path` from `other`, sampled every `STEP`.

    Both must come from the same way-points: the search starts at the same point of the same leg.
    """
    most = 0.0
    for leg, (begin, end) in enumerate(pairwise(path.passes)):
        count = max(2, min(10_000, int((end - begin) / STEP) + 1))
        their_begin, their_end = other.passes[leg : leg + 2]
        for i in range(count + 1):
            here = path.at(begin + (end - begin) * i / count)
            s = their_begin + (their_end - their_begin) * i / count
            most = max(most, _away(here, other, s))
    return most


def _away(here: PathPoint, other: Path, s: float) -> float:
    """[m] From a point to the nearest point of a path; the search starts at `s`."""
    cross_track = 0.0
    for _ in range(6):
        there = other.at(s)
        north, east = here.north - there.north, here.east - there.east
        ahead = north * cos(there.course) + east * sin(there.course)
        cross_track = abs(east * cos(there.course) - north * sin(there.course))
        s += ahead
    return cross_track
