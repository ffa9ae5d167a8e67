"""Angles that do not jump at ±π."""

from collections.abc import Iterable
from math import pi, remainder


def wrap(angle: float) -> float:
    """The same direction in (−π, π] [rad]."""
    wrapped = remainder(angle, 2 * pi)
    return pi if wrapped == -pi else wrapped


def accumulate(headings: Iterable[float]) -> list[float]:
    """Bounded headings [rad] as one continuous heading [rad], from the first one on.

    Each step is the shortest way, ψ_d += wrap(ψ_c(q) − ψ_c(q−1)). Algorithm 1 of Fernandes et al.
    2015 is meant to do this, but leaves its counter undefined wherever nothing wraps and starts a
    negative heading a turn too high.
    """
    total: list[float] = []
    before = 0.0
    for heading in headings:
        total.append(total[-1] + wrap(heading - before) if total else heading)
        before = heading
    return total
