"""A straight line through values over time, by least squares."""

from math import inf, sqrt
from typing import NamedTuple

FEWEST = 10  # samples; fewer make no line


class Line(NamedTuple):
    """Least squares through values over time."""

    level: float  # at the newest sample
    slope: float  # per second
    slope_std: float  # per second
    spread: float  # std about the line


UNKNOWN = Line(0.0, 0.0, inf, inf)


class LineFit:
    """Sums of the values so far."""

    __slots__ = ("_n", "_t", "_tt", "_tx", "_x", "_xx")

    def __init__(self) -> None:
        self._n = 0
        self._t = self._tt = self._x = self._xx = self._tx = 0.0

    def add(self, t: float, x: float) -> None:
        self._n += 1
        self._t += t
        self._tt += t * t
        self._x += x
        self._xx += x * x
        self._tx += t * x

    def line(self, newest: float) -> Line:
        """Up to the time `newest` [s]."""
        n = self._n
        if n < FEWEST:
            return UNKNOWN
        t, x = self._t / n, self._x / n
        tt, tx, xx = self._tt - n * t * t, self._tx - n * t * x, self._xx - n * x * x
        if tt <= 0.0:
            return UNKNOWN
        slope = tx / tt
        spread = sqrt(max(0.0, xx - slope * tx) / (n - 2))
        return Line(x + slope * (newest - t), slope, spread / sqrt(tt), spread)
