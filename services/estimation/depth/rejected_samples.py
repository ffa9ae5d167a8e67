"""Rejected pressure samples: do they agree with each other, though not with the filter?

If their innovations are all the same, pressure has jumped and the filter's motion is right. If not,
but the depths themselves lie on a line, the filter is wrong. If neither, the pressure is noise.
"""

from services.estimation.line_fit import Line, LineFit

# A filter that leaves the samples as fast is wrong. A jump of the pressure keeps its size.
DIVERGES_IN, DIVERGES_BY = 0.25, 0.5  # [s], [m/s]


class RejectedSamples:
    """Those in a row since `since_ns` [ns]."""

    __slots__ = ("_depths", "_first", "_innovations", "_seconds", "_since_ns", "patience")

    def __init__(self, depth: float, stamp_ns: int, patience: float) -> None:
        """`patience`: [s] of rejected samples before they are judged."""
        self.patience = patience
        self._since_ns, self._seconds = stamp_ns, 0.0
        self._first = depth  # sums of squares of small numbers are accurate
        self._innovations, self._depths = LineFit(), LineFit()

    def add(self, innovation: float, depth: float, stamp_ns: int) -> bool:
        """One sample and its innovation [m]. True: it is time to judge."""
        self._seconds = (stamp_ns - self._since_ns) * 1e-9
        self._innovations.add(self._seconds, innovation)
        self._depths.add(self._seconds, depth - self._first)
        return self._seconds > self.patience

    def diverges(self, most: float) -> bool:
        """Do samples within `most` [m] of a line leave the filter ever further behind?"""
        if self._seconds <= DIVERGES_IN:
            return False
        away = self.innovations
        fast = abs(away.slope) > DIVERGES_BY + 3.0 * away.slope_std
        return fast and away.slope * away.level > 0.0 and self.depths.spread <= most

    @property
    def innovations(self) -> Line:
        return self._innovations.line(self._seconds)

    @property
    def depths(self) -> Line:
        line = self._depths.line(self._seconds)
        return line._replace(level=line.level + self._first)
