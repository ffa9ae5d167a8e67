"""The pieces of the reference model of Fernandes et al. 2015, each with its own time from 0.

A change of speed is a `Pull` (acceleration fades in) followed by a `Settle` (it fades out); between
two changes of speed there is a `Cruise`. Any position unit, seconds, signs of the real motion.
"""

from dataclasses import dataclass
from math import exp
from typing import NamedTuple

from services.reference.trajectory.minimum_jerk import Sample


class Pull(NamedTuple):
    """The acceleration grows from 0 towards `a`; first subphase, (49)-(51) and (55)-(57)."""

    duration: float  # [s] ≥ 0
    v0: float  # speed at its start
    a: float  # acceleration it tends to
    tau: float  # [s] time constant
    left: float  # [-] e^−ξ, the share of `a` that is still missing at the end

    @property
    def length(self) -> float:
        """Distance covered, (69) and (71)."""
        t, tau = self.duration, self.tau
        return self.v0 * t + self.a * (t * t / 2 - tau * t + tau * tau * (1 - self.left))

    def at(self, t: float) -> Sample:
        tau, fade = self.tau, exp(-t / self.tau)
        grown = 1 - fade
        return Sample(
            self.v0 * t + self.a * (t * t / 2 - tau * t + tau * tau * grown),
            self.v0 + self.a * (t - tau * grown),
            self.a * grown,
            self.a * fade / tau,
        )


class Settle(NamedTuple):
    """The speed bends into `v1` exponentially; second subphase, (49)-(51) and (55)-(57)."""

    duration: float  # [s] ≥ 0
    v1: float  # speed it tends to
    gap: float  # v1 minus the speed at its start
    tau: float  # [s] time constant
    left: float  # [-] θ0, the share of `gap` that is still missing at the end

    @property
    def length(self) -> float:
        """Distance covered, (70) and (72)."""
        return self.v1 * self.duration - self.gap * self.tau * (1 - self.left)

    def at(self, t: float) -> Sample:
        fade = exp(-t / self.tau)
        a = self.gap * fade / self.tau
        return Sample(
            self.v1 * t - self.gap * self.tau * (1 - fade),
            self.v1 - self.gap * fade,
            a,
            -a / self.tau,
        )


class Cruise(NamedTuple):
    """Constant speed, (52)-(54)."""

    duration: float  # [s] ≥ 0
    v: float

    @property
    def length(self) -> float:
        return self.v * self.duration

    def at(self, t: float) -> Sample:
        return Sample(self.v * t, self.v, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class SpeedChange:
    """How a speed changes with `rate`: durations and distances are linear and quadratic in it.

    Changing from u to w takes (pull + settle) |w − u| / rate and covers
    |w − u| / rate · (weight_from u + weight_to w). Speeding up from 0 the weight_to is κ_a of (27),
    slowing to 0 the weight_from is κ_d of (28).
    """

    rate: float  # per s², > 0
    share: float  # [-] of the speed change made by the pull: θ_a, or 1 − θ_d
    xi: float  # [-] ξ, steepness of the start of the pull
    theta_0: float  # [-] θ0, where the settling is cut off
    pull: float  # duration of the pull in units of |w − u| / rate
    settle: float  # the same for the settling
    weight_from: float
    weight_to: float

    def distance(self, u: float, w: float) -> float:
        """Distance from speed u ≥ 0 to speed w ≥ 0."""
        return abs(w - u) / self.rate * (self.weight_from * u + self.weight_to * w)

    def phases(self, u: float, w: float) -> tuple[Pull, Settle]:
        """The two pieces from velocity u to velocity w; of no duration when u = w."""
        unit = abs(w - u) / self.rate  # [s]
        a = self.rate if w > u else -self.rate
        tau_pull, tau_settle = self.share * unit / (self.xi - 1), (1 - self.share) * unit
        return (
            Pull(self.pull * unit, u, a, tau_pull, exp(-self.xi)),
            Settle(self.settle * unit, w, (w - u) * (1 - self.share), tau_settle, self.theta_0),
        )
