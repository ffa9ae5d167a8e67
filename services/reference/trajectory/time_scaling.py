"""Time scaling: a reference that waits for the vehicle, on a clock that can slow to a standstill.

The clock τ advances with dτ/dt = λ, 0 (wait) to 1 (run), a jerk-bounded minimum-jerk reference.
The motion in real time is as smooth as the reference up to C²:

    p = p_r(τ)    v = v_r(τ) λ    a = a_r(τ) λ² + v_r(τ) dλ/dt

It replaces the waiting of Fernandes et al. 2015 (130), which holds the position while the velocity
reference continues.
"""

from dataclasses import dataclass, field

from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample


@dataclass(slots=True)
class WaitingClock:
    """Waits while the vehicle is too far from its reference, resumes once it is close again. Time
    is the caller's, in seconds, and never decreases."""

    wait_above: float  # error above which the reference waits
    resume_below: float  # and, once it waits, below which it resumes
    limits: Limits  # of λ: d²λ/dt² [1/s²], dλ/dt [1/s]
    since: float = 0.0  # [s] real time at which the reference starts, running
    waiting: bool = field(default=False, init=False)
    _ramp: Ramp = field(init=False)

    def __post_init__(self) -> None:
        self._ramp = Ramp(self.limits, target=1.0, since=self.since)

    def watch(self, error: float, t: float) -> None:
        """Take in the vehicle's error from its reference at `t` [s]; for a vector, the norm."""
        size = abs(error)
        self.waiting = size >= self.resume_below if self.waiting else size > self.wait_above
        self._ramp.aim(0.0 if self.waiting else 1.0, t)

    def at(self, t: float) -> Sample:
        """τ [s], λ [-], dλ/dt [1/s] and d²λ/dt² [1/s²] at `t` [s] of real time."""
        return self._ramp.at(t)


def scaled_sample(reference: Sample, clock: Sample) -> Sample:
    """The reference at τ, in real time."""
    (position, v, a, j), (_, rate, change, bend) = reference, clock
    acceleration = a * (rate * rate) + v * change
    jerk = j * rate**3 + 3 * a * rate * change + v * bend
    return Sample(position, v * rate, acceleration, jerk)
