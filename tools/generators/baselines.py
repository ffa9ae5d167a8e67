"""The usual ways of turning a stick into a velocity reference, to be compared with.

Source: Andrén 2023, chapter 4, Figs 4.2 and 4.3. Each has `aim` and `at` like
`minimum_jerk.Ramp`: exact at any time, also between samples. Any position unit, seconds.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, cosh, exp, inf, isfinite, sin, sinh, sqrt
from typing import Protocol

from services.reference.trajectory.minimum_jerk import Limits, Sample, Segment, along

Planner = Callable[[float, float, float], list[Segment]]  # velocity, acceleration, target


class BaselineReference(Protocol):
    """What every generator of a velocity reference can do."""

    def aim(self, target: float, t: float) -> None:
        """From `t` [s] on, go to velocity `target`."""
        ...

    def at(self, t: float) -> Sample:
        """The reference at `t` [s] ≥ the last change of target."""
        ...


@dataclass(slots=True)
class Direct:
    """Direct integration: the stick is the velocity. Acceleration and jerk are impulses at each
    change of target, which no number can show: both are given as 0."""

    position: float = 0.0
    target: float = 0.0
    since: float = 0.0  # [s]

    def at(self, t: float) -> Sample:
        return Sample(self.position + self.target * (t - self.since), self.target, 0.0, 0.0)

    def aim(self, target: float, t: float) -> None:
        self.position, self.target, self.since = self.at(t).position, target, t


@dataclass(slots=True)
class Filter:
    """Second-order filter, a mass with spring and damper: v'' = w² (target - v) - 2 ζ w v'.

    The closed form of its response, so the sampling time does not matter.
    """

    frequency: float = 10.0  # [rad/s] w, > 0
    damping: float = 0.8  # [-] ζ, > 0
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0
    target: float = 0.0
    since: float = 0.0  # [s]

    def __post_init__(self) -> None:
        for name, value in (("frequency", self.frequency), ("damping", self.damping)):
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and above 0, found {value}")

    def at(self, t: float) -> Sample:
        t -= self.since
        w, damp = self.frequency, self.damping * self.frequency
        y0, a0 = self.velocity - self.target, self.acceleration
        c, s = _modes(t, w, self.damping)
        y = y0 * c + (a0 + damp * y0) * s
        a = a0 * c - (w * w * y0 + damp * a0) * s
        # y'' = -w² y - 2 ζ w y' integrated once gives the position.
        x = self.position + self.target * t - (a - a0 + 2 * damp * (y - y0)) / (w * w)
        return Sample(x, self.target + y, a, -w * w * y - 2 * damp * a)

    def aim(self, target: float, t: float) -> None:
        self.position, self.velocity, self.acceleration, _ = self.at(t)
        self.target, self.since = target, t


def _modes(t: float, w: float, damping: float) -> tuple[float, float]:
    """The damped cosine and the damped sine over its frequency; hyperbolic when over-damped."""
    square, decay = w * w * (1 - damping * damping), damping * w
    root = sqrt(abs(square))
    if root * t < 1e-6:  # also exactly critical damping
        return exp(-decay * t), t * exp(-decay * t)
    if square > 0:
        return cos(root * t) * exp(-decay * t), sin(root * t) * exp(-decay * t) / root
    if root * t < 1:
        return cosh(root * t) * exp(-decay * t), sinh(root * t) * exp(-decay * t) / root
    slow, fast = exp((root - decay) * t), exp(-(root + decay) * t)
    return (slow + fast) / 2, (slow - fast) / (2 * root)


def minimum_time(
    velocity: float, acceleration: float, target: float, limits: Limits
) -> list[Segment]:
    """The quickest transition to (target, 0) with jerk and acceleration limits: the jerk is
    always at a limit or zero. Segments as of `minimum_jerk.solve`, at most three.

    Which way to begin follows from where constant jerk to zero acceleration would lead.

    Raises:
        ValueError: a number is not finite, or a limit is not above 0.
    """
    jerk, a_max = limits
    if not all(map(isfinite, (velocity, acceleration, target, jerk))):
        raise ValueError("velocity, acceleration, target and jerk must be finite")
    if not (jerk > 0 and a_max > 0):
        raise ValueError(f"jerk and acceleration must be above 0, found {jerk} and {a_max}")
    left = target - velocity - acceleration * abs(acceleration) / (2 * jerk)
    sign = 1.0 if left > 0 or (left == 0 and acceleration < 0) else -1.0
    a, e = acceleration * sign, (target - velocity) * sign
    peak = min(sqrt(max(0.0, a * a / 2 + jerk * e)), a_max)
    peak = max(peak, min(a, a_max), 0.0)  # rounding must not turn the first part round
    rise, fall = abs(peak - a) / jerk, peak / jerk
    left = e - (a + peak) / 2 * rise - peak / 2 * fall  # below a_max it is rounding
    cruise = max(0.0, left / peak) if peak == a_max else 0.0
    parts: list[Segment] = []
    v = velocity
    for duration, a0, a1 in ((rise, a, peak), (cruise, peak, peak), (fall, peak, 0.0)):
        if duration > 0:
            j = 0.0 if a0 == a1 else jerk if a1 > a0 else -jerk
            parts.append(Segment(duration, v, sign * a0, sign * j, 0.0))
            v += sign * (a0 + a1) / 2 * duration
    return parts


@dataclass(slots=True)
class PlannedBaseline:
    """Any planner as a reference with its exact position: `Ramp` for laws other than its own."""

    plan: Planner
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0
    since: float = 0.0  # [s]
    segments: tuple[Segment, ...] = ()
    target: float = inf  # nothing was aimed at yet

    def at(self, t: float) -> Sample:
        if self.target == inf:
            return Sample(self.position, self.velocity, self.acceleration, 0.0)
        here = along(self.segments, t - self.since, self.target)
        return here._replace(position=self.position + here.position)

    def aim(self, target: float, t: float) -> None:
        if target == self.target:
            return
        here = self.at(t)
        self.segments = tuple(self.plan(here.velocity, here.acceleration, target))
        self.position, self.target, self.since = here.position, target, t
