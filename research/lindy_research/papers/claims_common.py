"""Shared by the claims about Andrén 2023."""

from collections.abc import Iterator
from random import Random

from lindy.api.references import Segment

State = tuple[float, float, float]  # velocity, acceleration, target
STATES = 300


def total_time(segments: list[Segment]) -> float:
    return sum(segment.duration for segment in segments)


def peak_jerk(segments: list[Segment]) -> float:
    """It is linear in each segment, so the greatest is at an end."""
    ends = ((s.j0, s.j0 + 2 * s.half_snap * s.duration) for s in segments)
    return max(abs(jerk) for pair in ends for jerk in pair)


def random_states(seed: int) -> Iterator[State]:
    random = Random(seed)
    for _ in range(STATES):
        yield random.uniform(-1, 1), random.uniform(-2, 2), random.uniform(-1, 1)
