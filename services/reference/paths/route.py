"""A path and a speed along it: the full reference of a vehicle that points along its course.

Source: Fernandes et al. 2015, (80) to (83) and (118) to (126). There, the speed along the path is
multiplied by the sign of the distance, which makes it 0 for one sample at the start of a part; here
it is the speed of the profile. The heading is the path's course, which has no jumps, so it need not
be accumulated.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, sin
from typing import NamedTuple, Protocol

from services.reference.paths.path import Path
from services.reference.trajectory.minimum_jerk import Sample
from services.reference.trajectory.profile import MotionProfile
from services.reference.trajectory.profile_sequence import sequence

ARRIVED = 1e-6  # [m] the profile may miss the end of the path by this much, [m/s] be this fast


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
