"""Jerk-bounded minimum-jerk velocity references (MJVR).

Source: Andrén 2023, "Online Minimum-Jerk Velocity", chapter 5, whose rule keeps the *end* jerk of
a transition at J but lets the jerk reach 3.8 J when the target changes in mid-transition. The law
here bounds the jerk by J and the acceleration by a_max in every case, equals the thesis wherever
that respects both, and is continuous in the state:

1. An acceleration of the wrong sign, or too high to arrive without overshoot, is first brought to
   zero at constant jerk J; one above a_max is brought down to a_max.
2. From there, one minimum-jerk cubic; or, when that would exceed a_max, a parabola up to a_max,
   a cruise at a_max and a parabola down that ends with jerk J.

At most four segments, in closed form, once per change of target. Units: any position unit, seconds.

Position targets: a pair of jerk-bounded minimum-jerk velocity references.

Andrén 2023 leaves positions as future work (7.2.2) and sketches one quintic (7.1), whose jerk may
reach 7.5 J and which has neither a velocity nor an acceleration limit. Here the motion is two
bounded transitions, from the present velocity to a peak and from the peak to rest, with a cruise
between them when the peak is the velocity limit. All limits hold from any state, and jerk is
continuous where the two transitions meet. It ends exactly on the target, at rest or with a speed
that is asked for.

Only the peak has no closed form; it is found by bisection, once per target.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, sqrt
from typing import NamedTuple, Protocol

from services.marine.summation import plain_sum


class Limits(NamedTuple):
    """Limits of a transition."""

    jerk: float  # per s³, > 0; also the jerk at the end of every transition
    acceleration: float = inf  # per s², > 0


State = tuple[float, float, float, float]  # position, velocity, acceleration, jerk


class Sample(NamedTuple):
    """The reference at one instant."""

    position: float
    velocity: float
    acceleration: float
    jerk: float


class MotionProfile(Protocol):
    """A motion along one coordinate, known in advance: what all generators return. Before 0 and
    after the end, velocity is constant."""

    @property
    def duration(self) -> float:
        """[s] From start to arrival."""
        ...

    def at(self, t: float) -> Sample:
        """Position (from 0), velocity, acceleration and jerk at `t` [s]."""
        ...


class Segment(NamedTuple):
    """A time segment of linear jerk: a(t) = a0 + j0 t + half_snap t²."""

    duration: float  # [s] > 0
    v0: float
    a0: float
    j0: float
    half_snap: float

    def at(self, t: float) -> Sample:
        """The reference `t` seconds into this segment, position counted from its start."""
        v0, a0, j0, s = self.v0, self.a0, self.j0, self.half_snap
        return Sample(
            t * (v0 + t * (a0 / 2 + t * (j0 / 6 + t * s / 12))),
            v0 + t * (a0 + t * (j0 / 2 + t * s / 3)),
            a0 + t * (j0 + t * s),
            j0 + 2 * s * t,
        )


def solve(velocity: float, acceleration: float, target: float, limits: Limits) -> list[Segment]:
    """Segments from (velocity, acceleration) to (target, 0). Empty when already there.

    Args:
        velocity, acceleration: of the reference now; any finite values.
        target: velocity, finite.
    """
    segments: list[Segment] = []
    v, a, e = velocity, acceleration, target - velocity
    sign = 1.0 if e >= 0 else -1.0
    if a * sign < 0 or a * a > 2 * limits.jerk * abs(e):
        v = _bring_to(0.0, v, a, limits.jerk, segments)
        a, e = 0.0, target - v
        sign = 1.0 if e >= 0 else -1.0
    elif a * sign > limits.acceleration:
        v = _bring_to(sign * limits.acceleration, v, a, limits.jerk, segments)
        a, e = sign * limits.acceleration, target - v
    segments += _mirrored(_rise(a * sign, e * sign, limits), v, sign)
    return segments


def along(segments: Sequence[Segment], t: float, target: float) -> Sample:
    """The reference `t` seconds into these segments, position counted from their start; constant
    velocity `target` after the last."""
    position = 0.0
    for segment in segments:
        if t < segment.duration:
            here = segment.at(t)
            return here._replace(position=position + here.position)
        position += segment.at(segment.duration).position
        t -= segment.duration
    return Sample(position + target * t, target, 0.0, 0.0)


def reader(segments: Iterable[Segment], target: float) -> Callable[[float], State]:
    """A fast evaluator of a plan: a function of the time [s] since its start.

    Position counts from the start; after the end the target velocity is held.
    """
    parts: list[tuple[float, float, float, float, float, float, float]] = []
    begin = x = 0.0
    for part in segments:
        parts.append((begin, begin + part.duration, x, *part[1:]))
        begin += part.duration
        x += part.at(part.duration).position
    whole = begin

    def read(t: float) -> State:
        for begin, end, x0, v0, a0, j0, half_snap in parts:
            if t < end:
                t -= begin
                bend = t * t * half_snap
                a = a0 + t * j0 + bend
                v = v0 + t * (a0 + a - bend / 3) / 2
                return x0 + t * ((v0 + v) / 2 + t * (a0 - a) / 12), v, a, j0 + 2 * t * half_snap
        return x + target * (t - whole), target, 0.0, 0.0

    return read


def _bring_to(to: float, v: float, a: float, jerk: float, segments: list[Segment]) -> float:
    """Constant jerk until the acceleration is `to`; returns the velocity reached."""
    duration = abs(a - to) / jerk
    if duration > 0:
        segments.append(Segment(duration, v, a, jerk if a < to else -jerk, 0.0))
    return v + (a + to) / 2 * duration


def _rise(a: float, e: float, limits: Limits) -> list[Segment]:
    """Segments with velocities counted from now, for 0 ≤ a ≤ a_max and a² ≤ 2 J e."""
    jerk, peak = limits
    if e <= 0:
        return []
    if peak < inf:
        q = jerk * jerk / (4 * peak)  # half the snap of both parabolas, (5.20) in sign and factor
        ramp_time, fade_time = sqrt(max(0.0, peak - a) / q), 2 * peak / jerk
        ramp = peak * ramp_time - q * ramp_time**3 / 3
        fade = 4 * peak * peak / (3 * jerk)
        if e > ramp + fade:
            cruise_time = (e - ramp - fade) / peak
            parts = [
                Segment(ramp_time, 0.0, a, 2 * q * ramp_time, -q),
                Segment(cruise_time, ramp, peak, 0.0, 0.0),
                Segment(fade_time, e - fade, peak, 0.0, -q),
            ]
            return [part for part in parts if part.duration > 0]
    duration = 6 * e / (a + sqrt(a * a + 6 * jerk * e))  # largest real root of (5.12)
    if duration == 0:
        return []
    return [Segment(duration, 0.0, a, jerk - 2 * a / duration, (a / duration - jerk) / duration)]


def _mirrored(parts: list[Segment], v: float, sign: float) -> list[Segment]:
    return [
        Segment(p.duration, v + sign * p.v0, sign * p.a0, sign * p.j0, sign * p.half_snap)
        for p in parts
    ]


@dataclass(slots=True)
class Ramp:
    """A velocity reference that moves to a target, with its exact position integral.

    Time is the caller's, in seconds, and never decreases. The result does not depend on how often
    it is evaluated: a target change solves once, an evaluation is one polynomial.
    """

    limits: Limits
    position: float = 0.0  # where the present plan began
    target: float = 0.0
    since: float = 0.0  # [s] when the present plan began
    segments: tuple[Segment, ...] = ()
    in_force: Limits = field(init=False)  # what the present plan respects
    rides: bool = False  # another generator's motion, whose limits are not known
    _read: Callable[[float], State] = field(init=False)
    _end: float = field(init=False)  # [s] of the present plan

    def __post_init__(self) -> None:
        here = Sample(self.position, 0.0, 0.0, 0.0)
        self._begin(here, self.segments, self.target, self.since)

    def at(self, t: float) -> Sample:
        """The reference at time `t` [s] ≥ the last change of target."""
        x, v, a, j = self._read(t - self.since)
        return Sample(self.position + x, v, a, j)

    def aim(self, target: float, t: float) -> None:
        """From `t` [s] on, go to velocity `target`. No effect if that is the target already."""
        if target != self.target:
            self.take(self.at(t), t, target)

    def brake(self, t: float, limits: Limits | None = None) -> None:
        """From `t` [s] on, come to rest; within other limits if given."""
        self.take(self.at(t), t, limits=limits)

    def ride(self, read: Callable[[float], State], end: float = inf) -> None:
        """From now on, the motion of another generator, at each time [s], until it is taken over
        from; at rest from `end` [s] on."""
        self._begin(Sample(0.0, 0.0, 0.0, 0.0), (), 0.0, 0.0)
        self._read, self._end, self.rides = read, end, True

    def run(self, segments: Sequence[Segment], t: float) -> None:
        """From `t` [s] on, follow these segments, then rest. They must begin with the velocity and
        acceleration of the reference at `t`."""
        self._begin(self.at(t), segments, 0.0, t)

    def take(
        self, here: Sample, t: float, target: float = 0.0, limits: Limits | None = None
    ) -> None:
        """Continue from another generator's reference at `t` [s], and go to velocity `target`;
        within other limits if given."""
        limits = limits or self.limits
        self._begin(here, solve(*here[1:3], target, limits), target, t)
        self.in_force = limits

    def shift(self, by: float) -> None:
        """Move the position reference; its velocity is unchanged."""
        self.position += by

    def rest(self, position: float, t: float) -> None:
        """Rest at `position` from `t` [s] on; discards the plan."""
        self._begin(Sample(position, 0.0, 0.0, 0.0), (), 0.0, t)

    def settles(self) -> float:
        """[s] When the target velocity is reached."""
        return self._end

    def to_go(self, t: float) -> float:
        """Distance from `t` [s] to where the target velocity is reached."""
        return self.at(max(t, self.settles())).position - self.at(t).position

    def _begin(self, here: Sample, segments: Sequence[Segment], target: float, t: float) -> None:
        self.position, self.segments = here.position, tuple(segments)
        self.target, self.since, self.in_force, self.rides = target, t, self.limits, False
        self._read = reader(self.segments, target)
        self._end = t + plain_sum(segment.duration for segment in self.segments)


# Position targets: a pair of these references.
HALVINGS = 80  # enough to reach the last bit of a float


class PositionMove(NamedTuple):
    """A motion to a position, from any state of the reference. A `MotionProfile`."""

    segments: tuple[Segment, ...]
    peak: float  # velocity between the two transitions
    final: float = 0.0  # velocity after the end

    @property
    def duration(self) -> float:
        """[s]"""
        return plain_sum(segment.duration for segment in self.segments)

    def at(self, t: float) -> Sample:
        """Position from the start, velocity, acceleration and jerk."""
        return along(self.segments, t, self.final)


def pair(
    distance: float,
    limits: Limits,
    v_max: float,
    velocity: float = 0.0,
    acceleration: float = 0.0,
    final: float = 0.0,
) -> PositionMove:
    """The motion over `distance` (either sign).

    Args:
        v_max: > 0, highest cruise speed. A present speed above it is reduced.
        velocity, acceleration: of the reference now.
        final: velocity at the end, at most v_max.

    Raises:
        ValueError: v_max is not positive.
    """
    if not v_max > 0:
        raise ValueError(f"v_max: found {v_max}, must be more than 0")

    def over(peak: float, cruise: float = 0.0) -> PositionMove:
        first = solve(velocity, acceleration, peak, limits)
        middle = [Segment(cruise, peak, 0.0, 0.0, 0.0)] if cruise > 0 else []
        return PositionMove((*first, *middle, *solve(peak, 0.0, final, limits)), peak, final)

    for fastest in (v_max, -v_max):
        missing = (distance - travelled(over(fastest).segments)) / fastest
        if missing >= 0:
            return over(fastest, missing)
    peaks = _peaks(distance, limits, v_max, velocity, acceleration, final)
    candidates = [over(peak) for peak in peaks]
    return min(candidates, key=lambda candidate: candidate.duration)


def go(ramp: Ramp, end: float, limits: Limits, fastest: float, t: float) -> None:
    """From `t` [s] on, move a ramp to the position `end`, where it rests."""
    here = ramp.at(t)
    plan = pair(end - here.position, limits, fastest, here.velocity, here.acceleration)
    ramp.run(plan.segments, t)


def travelled(segments: tuple[Segment, ...] | list[Segment]) -> float:
    """Distance over a whole list of segments."""
    return plain_sum(segment.at(segment.duration).position for segment in segments)


def _peaks(
    distance: float,
    limits: Limits,
    v_max: float,
    velocity: float,
    acceleration: float,
    final: float,
) -> list[float]:
    """Peaks that travel exactly `distance`. The distance grows with the peak, except between the
    final velocity, 0, and the velocity reached when the present acceleration is brought to zero,
    where it is not monotonic; so each of the ranges between them may hold a solution."""

    def excess(peak: float) -> float:
        first = travelled(solve(velocity, acceleration, peak, limits))
        return first + travelled(solve(peak, 0.0, final, limits)) - distance

    coasting = velocity + acceleration * abs(acceleration) / (2 * limits.jerk)
    coasting = max(-v_max, min(v_max, coasting))
    edges = sorted({-v_max, 0.0, coasting, final, v_max})
    return [
        _root(excess, low, high)
        for low, high in pairwise(edges)
        if excess(low) <= 0 <= excess(high) or excess(high) <= 0 <= excess(low)
    ]


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where the function changes its sign between `low` and `high`."""
    rising = function(low) <= 0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if (function(middle) <= 0) == rising:
            low = middle
        else:
            high = middle
    return (low + high) / 2
