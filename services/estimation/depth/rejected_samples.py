"""Rejected pressure samples: do they agree with each other, though not with the filter?

If their innovations are all the same, pressure has jumped and the filter's motion is right. If not,
but the depths themselves lie on a line, the filter is wrong. If neither, the pressure is noise.
"""

from math import inf, sqrt
from typing import NamedTuple

FEWEST = 10  # samples; fewer make no line


class Line(NamedTuple):
    """Least squares through values over time."""

    level: float  # [m] at the newest sample
    slope: float  # [m/s]
    slope_std: float  # [m/s]
    spread: float  # [m] std about the line


UNKNOWN = Line(0.0, 0.0, inf, inf)


class _Sums:
    """Of the values over time, for their line."""

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


class RejectedSamples:
    """Those in a row since `since_ns` [ns]."""

    __slots__ = ("_depths", "_first", "_innovations", "_seconds", "_since_ns", "patience")

    def __init__(self, depth: float, stamp_ns: int, patience: float) -> None:
        """`patience`: [s] of rejected samples before they are judged."""
        self.patience = patience
        self._since_ns, self._seconds = stamp_ns, 0.0
        self._first = depth  # sums of squares of small numbers are accurate
        self._innovations, self._depths = _Sums(), _Sums()

    def add(self, innovation: float, depth: float, stamp_ns: int) -> bool:
        """One sample and its innovation [m]. True: it is time to judge."""
        self._seconds = (stamp_ns - self._since_ns) * 1e-9
        self._innovations.add(self._seconds, innovation)
        self._depths.add(self._seconds, depth - self._first)
        return self._seconds > self.patience

    @property
    def innovations(self) -> Line:
        return self._innovations.line(self._seconds)

    @property
    def depths(self) -> Line:
        line = self._depths.line(self._seconds)
        return line._replace(level=line.level + self._first)
