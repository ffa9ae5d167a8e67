"""Emergency stop of any motion: the velocity goes to zero, jerk-bounded, along the same coordinate.

On a path the coordinate is the distance along it, so the drone stops on the path. The stop is a
minimum-jerk velocity reference (`minimum_jerk`) with limits of its own, at most four segments, so
the stopping distance is known at once.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

from services.marine.summation import plain_sum
from services.reference.trajectory.minimum_jerk import (
    Limits,
    MotionProfile,
    Sample,
    Segment,
    along,
    solve,
)


@dataclass(frozen=True, slots=True)
class StoppedMotion:
    """A `MotionProfile`: the original motion until `since`, then the stop."""

    before: Callable[[float], Sample]
    since: float  # [s] when the stop begins, on the clock of the original motion
    position: float  # at that moment
    segments: tuple[Segment, ...]

    @property
    def duration(self) -> float:
        """[s] Time of standstill, on the clock of the original motion."""
        return self.since + self.stop_time

    @property
    def stop_time(self) -> float:
        """[s] From `since` to standstill."""
        return plain_sum(segment.duration for segment in self.segments)

    def at(self, t: float) -> Sample:
        """Position, velocity, acceleration, jerk at `t` [s]."""
        if t < self.since:
            return self.before(t)
        here = along(self.segments, t - self.since, 0.0)
        return here._replace(position=self.position + here.position)


def stop(profile: MotionProfile, t: float, limits: Limits) -> StoppedMotion:
    """Stop a motion from `t` [s] on, with continuous position, velocity and acceleration.

    Raises:
        ValueError: a limit is not above 0, or `t` or the motion at `t` is not finite.
    """
    return stop_motion(profile.at, t, limits)


def stop_motion(motion: Callable[[float], Sample], t: float, limits: Limits) -> StoppedMotion:
    """The same for any function of time, such as a scaled motion (`time_scaling`)."""
    if not (limits.jerk > 0 and isfinite(limits.jerk)):
        raise ValueError(f"jerk of a stop is {limits.jerk}, expected a finite number above 0")
    if not limits.acceleration > 0:
        raise ValueError(f"acceleration of a stop is {limits.acceleration}, expected above 0")
    if not isfinite(t):
        raise ValueError(f"time of a stop is {t}, expected a finite number of seconds")
    here = motion(t)
    if not all(map(isfinite, here)):
        raise ValueError(f"the motion to be stopped is not finite at {t:g} s: {here}")
    segments = tuple(solve(here.velocity, here.acceleration, 0.0, limits))
    return StoppedMotion(motion, t, here.position, segments)
