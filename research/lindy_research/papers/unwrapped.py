"""Unwrapping of headings, as Algorithm 1 of Fernandes et al. 2015 is meant."""

from collections.abc import Iterable

from lindy.api.vehicle import wrapped


def accumulate(headings: Iterable[float]) -> list[float]:
    """Wrapped headings [rad] as one continuous heading [rad], starting at the first.

    Each step is the shortest turn, ψ_d += wrap(ψ_c(q) − ψ_c(q−1)). Algorithm 1 of Fernandes et al.
    2015 has the same purpose, but leaves its counter undefined where nothing wraps and starts a
    negative heading one turn too high.
    """
    total: list[float] = []
    before = 0.0
    for heading in headings:
        total.append(total[-1] + wrapped(heading - before) if total else heading)
        before = heading
    return total
