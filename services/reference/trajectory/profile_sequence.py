"""Several consecutive motions along one coordinate as one motion."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from math import isclose

from services.reference.trajectory.minimum_jerk import Sample
from services.reference.trajectory.profile import MotionProfile


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
