"""The simulations behind section 6.1, each made once, for figures, claims and the bench."""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Literal

import numpy as np

from lindy.api.references import BaselineReference, Direct, Limits, Ramp
from lindy_research.papers.identified_inputs import (
    LOG_END,
    STEP_END,
    STEP_ON,
    expected_from_noise,
    log_stick,
    sines,
    step_stick,
    thesis_rule_reference,
)
from lindy_research.papers.identified_plant import (
    DT,
    END_JERK,
    Floats,
    PlantRun,
    Sums,
    follow,
    law,
    rise_time,
    sums,
)

Stick = Literal["step", "log"]
Summed = Literal["position", "thrust"]
NAIVE = 0.0  # in place of an end jerk: the stick is the reference


def reference(jerk: float) -> BaselineReference:
    """Of this end jerk [m/s³], or the naive one."""
    return Direct() if jerk == NAIVE else thesis_rule_reference(jerk)


@cache
def run(
    jerk: float = END_JERK, stick: Stick = "step", share: float = 1.0, *, disturbed: bool = True
) -> PlantRun:
    """The thesis' controller, with this share of the acceleration feed-forward."""
    values = step_stick() if stick == "step" else log_stick()
    force = sines(len(values)) if disturbed else None
    return follow(reference(jerk), values, force, by=law(share))


@cache
def improved(jerk: float, observer: float, *, disturbed: bool = True) -> PlantRun:
    """Lindy's way through the step: bounded law, feed-forward for held forces, and a disturbance
    observer of this bandwidth [rad/s]."""
    values = step_stick()
    force = sines(len(values)) if disturbed else None
    return follow(Ramp(Limits(jerk)), values, force, by=law(observer=observer, sampled=True))


def expected_sums(jerk: float, stick: Stick) -> Sums:
    """On average over random noise; the peak is that without noise."""
    noise = expected_from_noise(round((STEP_END if stick == "step" else LOG_END) / DT))
    still = sums(run(jerk, stick, disturbed=False))
    return Sums(*(a + b for a, b in zip(still, noise, strict=True)))


@cache
def equal_rise_jerk() -> float:
    """[m/s³] The end jerk with which the vehicle rises as fast as with the naive reference."""
    naive = rise_time(run(NAIVE, disturbed=False), STEP_ON)
    return equal(lambda jerk: rise_time(run(jerk, disturbed=False), STEP_ON), naive, 1.0, 10.0)


@cache
def improved_equal_rise_jerk(observer: float) -> float:
    """[m/s³] As `equal_rise_jerk`, for Lindy's way."""
    naive = rise_time(run(NAIVE, disturbed=False), STEP_ON)
    return equal(
        lambda jerk: rise_time(improved(jerk, observer, disturbed=False), STEP_ON), naive, 1.0, 10.0
    )


def lowest(shares: Sequence[float], totals: Sequence[float]) -> float:
    """Where the parabola through these three points is lowest."""
    square, slope, _ = np.polyfit(shares, totals, 2)
    return float(-slope / (2 * square))


@cache
def best_share(of: Summed, jerk: float = END_JERK) -> float:
    """[-] Share of the acceleration feed-forward with the least sum. Errors and thrust are affine
    in the share, so the sums are parabolas and three runs say it all."""
    shares = (0.0, 1.0, 2.0)
    totals = [getattr(sums(run(jerk, share=share, disturbed=False)), of) for share in shares]
    return lowest(shares, totals)


def overshoot(values: Floats, target: float) -> float:
    """[-] How far beyond the target, as a share of it."""
    return float(np.max(values)) / target - 1.0


def equal(left: Callable[[float], float], right: float, low: float, high: float) -> float:
    """Where a falling function has the value `right`, by halving [low, high]."""
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if left(middle) > right else (low, middle)
    return (low + high) / 2
