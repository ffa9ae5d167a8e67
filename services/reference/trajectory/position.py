"""Position targets: a pair of jerk-bounded minimum-jerk velocity references.

Andrén 2023 leaves positions as future work (7.2.2) and sketches one quintic (7.1), whose jerk may
reach 7.5 J and which has neither a velocity nor an acceleration limit. Here the motion is two
bounded transitions, from the present velocity to a peak and from the peak to rest, with a cruise
between them when the peak is the velocity limit. All limits hold from any state, and jerk is
continuous where the two transitions meet. It ends exactly on the target, at rest or with a speed
that is asked for.

Only the peak has no closed form; it is found by bisection, once per target.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

from services.marine.summation import plain_sum
from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample, Segment, along, solve

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
