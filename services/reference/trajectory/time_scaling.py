"""Time scaling: a reference that waits for the vehicle, on a clock that can slow to a standstill.

The clock τ advances with dτ/dt = λ. λ moves between 1 (run) and 0 (wait) as a jerk-bounded
minimum-jerk reference, so λ and dλ/dt are continuous. The motion in real time is

    p = p_r(τ)    v = v_r(τ) λ    a = a_r(τ) λ² + v_r(τ) dλ/dt

exactly consistent at every instant, and as smooth as the reference up to C². It replaces the
waiting of Fernandes et al. 2015 (130), which holds the position while the velocity reference
continues.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample


class PathClock(NamedTuple):
    """The clock of a waiting reference at one instant of real time."""

    tau: float  # [s] time of the reference
    rate: float  # [-] λ, 0 to 1
    rate_change: float  # [1/s] dλ/dt
    rate_bend: float  # [1/s²] d²λ/dt²


@dataclass(slots=True)
class WaitingClock:
    """Waits while the vehicle is too far from its reference, resumes once it is close again.

    Time is the caller's, in seconds, and never decreases.
    """

    wait_above: float  # e_hi, error above which the reference waits
    resume_below: float  # e_lo < e_hi, error below which it resumes
    limits: Limits  # of λ: jerk limits d²λ/dt² [1/s²], acceleration limits dλ/dt [1/s]
    since: float = 0.0  # [s] real time at which the reference starts, running
    waiting: bool = field(default=False, init=False)
    _ramp: Ramp = field(init=False)  # its position is τ, its velocity λ

    def __post_init__(self) -> None:
        self._ramp = Ramp(self.limits, target=1.0, since=self.since)

    def watch(self, error: float, t: float) -> None:
        """Take in the vehicle's error from its reference at `t` [s]; for a vector, the norm."""
        if abs(error) > self.wait_above:
            self.waiting = True
        elif abs(error) < self.resume_below:
            self.waiting = False
        self._ramp.aim(0.0 if self.waiting else 1.0, t)

    def at(self, t: float) -> PathClock:
        """The clock at `t` [s] of real time."""
        return PathClock(*self._ramp.at(t))


def scaled_sample(reference: Sample, clock: PathClock) -> Sample:
    """The reference at `clock.tau`, in real time.

    Its jerk is j_r λ³ + 3 a_r λ dλ/dt + v_r d²λ/dt².
    """
    position, v, a, j = reference
    rate, change = clock.rate, clock.rate_change
    return Sample(
        position,
        v * rate,
        a * (rate * rate) + v * change,
        j * rate**3 + 3 * a * rate * change + v * clock.rate_bend,
    )
