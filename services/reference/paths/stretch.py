"""Motion over a given length between two given speeds, with the jerk-bounded law (Andrén 2023,
chapter 5, as bounded in `minimum_jerk.py`): up to a peak, a cruise if the peak is the limit, down.
"""

from typing import NamedTuple

from services.marine.summation import plain_sum
from services.reference.trajectory.minimum_jerk import Limits, Sample, Segment, along, solve

HALVINGS = 80  # enough to reach the last bit of a float


class Stretch(NamedTuple):
    """A motion that may begin and end with speed. A `MotionProfile`."""

    segments: tuple[Segment, ...]
    final: float  # velocity after the end

    @property
    def duration(self) -> float:
        """[s]"""
        return plain_sum(segment.duration for segment in self.segments)

    def at(self, t: float) -> Sample:
        """Position from the start, velocity, acceleration and jerk."""
        return along(self.segments, t, self.final)


def stretch(
    distance: float, limits: Limits, cruise: float, initial: float = 0.0, final: float = 0.0
) -> Stretch:
    """The fastest such motion over `distance` > 0.

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

    def over(peak: float) -> list[Segment]:
        return [*solve(initial, 0.0, peak, limits), *solve(peak, 0.0, final, limits)]

    slowest = max(initial, final)
    if (least := _length(over(slowest))) > distance:
        raise ValueError(
            f"{distance:.6g} m are too short to get from {initial:g} to {final:g} m/s, which needs"
            f" {least:.6g} m with this jerk and acceleration"
        )
    missing = distance - _length(over(cruise))
    if missing < 0:
        low, high = slowest, cruise
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if _length(over(middle)) > distance else (middle, high)
        return Stretch(tuple(over(low)), final)
    steady = [Segment(missing / cruise, cruise, 0.0, 0.0, 0.0)] if missing > 0 else []
    up, down = solve(initial, 0.0, cruise, limits), solve(cruise, 0.0, final, limits)
    return Stretch((*up, *steady, *down), final)


def _length(segments: list[Segment]) -> float:
    return plain_sum(segment.at(segment.duration).position for segment in segments)
