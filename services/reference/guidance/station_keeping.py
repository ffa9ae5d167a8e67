"""Station keeping: a position reference in NED, moved by the surge and sway sticks as body
velocities.

It is the sum of two motions. The initial motion, of the vehicle or a path, comes to rest in NED in
closed form (`vector.py`). The stick's velocity u is a vector reference in the body; with the
rotation R by the heading reference ψ, and S a quarter turn clockwise, in NED it is

    v = R u                a = R (u' + ψ' S u)
    j = R (u'' + 2 ψ' S u' + ψ'' S u - ψ'² u)

so position, velocity and acceleration are continuous because those of u and ψ are. Position is the
integral of v by the trapezoid rule with end correction, which is exact for cubics: exact at
constant heading, of fourth order while turning.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from math import dist, hypot
from typing import NamedTuple

import msgspec
from msgspec import UNSET, UnsetType

from messages.state import VehicleState
from messages.units import Finite
from services.marine.attitude import level_velocity, north_offset, turned, wrapped
from services.reference.trajectory.minimum_jerk import Limits, Sample
from services.reference.trajectory.vector import STILL, VectorRamp

# Where the vehicle is, by its state: its motion over the ground; depth and heading to tell.


Pair = tuple[float, float]  # north and east, or surge and sway


class GroundMotion(NamedTuple):
    """Position and velocity over the ground, NED."""

    position: Pair  # [m] north, east
    velocity: Pair  # [m/s] north, east
    offset: float  # [rad] north heading minus control heading


def ground_of(state: VehicleState) -> GroundMotion | None:
    """None when any part is unknown or invalid."""
    north, east, level = state.north, state.east, level_velocity(state)
    if north is None or east is None or level is None or not (north.valid and east.valid):
        return None
    offset = north_offset(state)
    velocity = turned(level, state.heading.value + offset)
    return GroundMotion((north.value, east.value), velocity, offset)


def whereabouts(state: VehicleState | None) -> tuple[float | UnsetType, float | UnsetType]:
    """Depth [m] and heading [rad] clockwise from north, ±π, for the list of drones; absent: not
    known."""
    if state is None:
        return UNSET, UNSET
    return (
        state.depth.value if state.depth.valid else UNSET,
        wrapped(state.heading.value + north_offset(state)) if state.heading.valid else UNSET,
    )


# [s] without a position; after a longer gap nobody knows where a new origin is.
MOST_GAP_S = 1.0


class HomePlace(msgspec.Struct, frozen=True):
    """What a restart in mid-dive needs."""

    north: Finite  # [m]
    east: Finite  # [m]
    origin: int  # of the position, as the state names it


@dataclass(slots=True)
class Home:
    """The first position that is measured while the drone is armed. It moves with the origin of the
    positions as long as they do not break off; then it is lost. Times `t` in seconds."""

    place: HomePlace | None = None
    lost: bool = False  # the positions began anew at a place that nobody knows
    _newest: tuple[float, Pair] | None = None  # [s], [m]

    def see(
        self, state: VehicleState | None, ground: GroundMotion | None, t: float, *, armed: bool
    ) -> None:
        if state is None or ground is None or not isinstance(state.origin, int):
            return
        before, self._newest = self._newest, (t, ground.position)
        if self.lost or (self.place is None and not armed):
            return
        (north, east), old = ground.position, self.place
        if old is None:
            self.place = HomePlace(north, east, state.origin)
        elif old.origin != state.origin:
            self.place, self.lost = None, before is None or t - before[0] > MOST_GAP_S
            if before is not None and not self.lost:
                by = north - before[1][0], east - before[1][1]
                self.place = HomePlace(old.north + by[0], old.east + by[1], state.origin)

    @property
    def missing(self) -> str:
        """Why it cannot be gone to; empty: it can."""
        if self.place is not None:
            return ""
        if self.lost:
            return (
                "home is not known any more: the position was lost on the way, and began anew; the "
                "next place where the drone is armed will be home"
            )
        return "home is not known: no position has been measured since the drone was armed"


AT_REST = Sample(0.0, 0.0, 0.0, 0.0)
AHEAD_STEPS = 20  # to the end of a stop: 0.1 mm of the way, also where the drone turns meanwhile


@dataclass(slots=True)
class StationKeeping:
    """Time is the caller's, in seconds, and never decreases; `step` advances it."""

    limits: Limits  # of the norms, for each of the two motions
    held: bool = False  # False: not in use
    offset: float = 0.0  # [rad] north heading minus control heading
    _initial: VectorRamp = field(init=False)  # [m/s] north, east: comes to rest
    _path: Callable[[float], tuple[Sample, Sample]] | None = None  # in the place of all of these
    _stick: VectorRamp = field(init=False)  # [m/s] surge, sway
    _moved: Pair = STILL  # [m] north, east: moved by the stick and by `shift`
    _stepped: float = 0.0  # [s] of the newest step
    _by_stick: tuple[Sample, Sample] = field(init=False)  # north, east at the newest step

    def __post_init__(self) -> None:
        self._initial, self._stick = VectorRamp(self.limits), VectorRamp(self.limits)
        self._by_stick = AT_REST, AT_REST

    @property
    def now(self) -> tuple[Sample, Sample]:
        """North and east at the newest step."""
        if self._path is not None:
            return self._path(self._stepped)
        return self._at(0), self._at(1)

    def take_measured(self, ground: GroundMotion, t: float) -> None:
        """Hold from `t` [s] on: start from the vehicle's motion and come to rest."""
        self.offset = ground.offset
        pairs = zip(ground.position, ground.velocity, strict=True)
        north, east = (Sample(x, v, 0.0, 0.0) for x, v in pairs)
        self.take(north, east, t)

    def take(self, north: Sample, east: Sample, t: float) -> None:
        """Start from another generator's motion at `t` [s], and come to rest."""
        self.ride(None, t)
        self._initial.take(north, east, t)

    def ride(self, path: Callable[[float], tuple[Sample, Sample]] | None, t: float) -> None:
        """From `t` [s] on, the motion of a path, at each time [s], until it is taken over from."""
        self._path, self.held = path, True
        self._stick.rest(t)
        self._moved, self._stepped, self._by_stick = STILL, t, (AT_REST, AT_REST)

    def step(self, heading: Sample, offset: float, t: float) -> None:
        """Advance to `t` [s], where the heading reference is `heading`. A new north offset takes
        effect only while the stick's motion is at rest, because it would rotate that motion."""
        stick, time = self._stick.at(t), t - self._stepped
        if all(s.velocity == 0.0 == s.acceleration for s in stick):
            self.offset = offset
        before, self._by_stick = self._by_stick, self._in_north(stick, heading)
        north, east = (
            x
            + time * (a.velocity + b.velocity) / 2
            + time * time * (a.acceleration - b.acceleration) / 12
            for x, a, b in zip(self._moved, before, self._by_stick, strict=True)
        )
        self._moved, self._stepped = (north, east), t

    def aim(self, velocity: Pair, t: float) -> None:
        """From `t` [s], the newest step, go to this surge and sway velocity [m/s]."""
        self._stick.aim(velocity, t)

    def brake(self, t: float, limits: Limits) -> None:
        """From `t` [s], the newest step, come to rest within these limits."""
        self._initial.aim(STILL, t, limits)
        self._stick.aim(STILL, t, limits)

    def shift(self, north: float, east: float) -> None:
        """Move the position reference without touching its velocity."""
        self._moved = (self._moved[0] + north, self._moved[1] + east)

    def settles(self) -> float:
        """[s] When the target velocity is reached."""
        return max(self._initial.settles(), self._stick.settles())

    def to_go(self, heading_at: Callable[[float], Sample]) -> float:
        """[m] Straight from the newest step to where the target velocity is reached, if the heading
        reference will be `heading_at` a time [s]."""
        ahead, since = copy(self), self._stepped
        time = max(0.0, self.settles() - since)
        for step in range(1, AHEAD_STEPS + 1):
            t = since + time * step / AHEAD_STEPS
            ahead.step(heading_at(t), self.offset, t)
        here, there = ([each.position for each in place.now] for place in (self, ahead))
        return dist(here, there)

    def error(self, ground: GroundMotion) -> tuple[Pair, float]:
        """[m] From the vehicle to the reference: north and east, and the norm."""
        north, east = (s.position - x for s, x in zip(self.now, ground.position, strict=True))
        return (north, east), hypot(north, east)

    def _at(self, axis: int) -> Sample:
        x, v, a, j = self._initial.at(self._stepped)[axis]
        _, by_v, by_a, by_j = self._by_stick[axis]
        return Sample(x + self._moved[axis], v + by_v, a + by_a, j + by_j)

    def _in_north(self, stick: tuple[Sample, Sample], heading: Sample) -> tuple[Sample, Sample]:
        """The stick's motion in NED, without its position."""
        (_, u, a, j), (_, v, b, k) = stick
        angle, r, bend = heading.position + self.offset, heading.velocity, heading.acceleration
        vn, ve = turned((u, v), angle)
        an, ae = turned((a - r * v, b + r * u), angle)
        jn, je = turned(
            (j - 2 * r * b - bend * v - r * r * u, k + 2 * r * a + bend * u - r * r * v), angle
        )
        return Sample(0.0, vn, an, jn), Sample(0.0, ve, ae, je)
