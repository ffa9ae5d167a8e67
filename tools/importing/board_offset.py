"""A board's clock against the logger's, known afterwards: no message arrives before it was stamped.

The offset (arrival - stamp) is never below the true difference of the clocks, and now and then a
message comes without delay. So the difference is the lower convex hull of all offsets: straight
while both crystals are even, and never above any of them.
"""

from bisect import bisect_right
from statistics import median

from messages.units import Ns

BIN_NS = 5_000_000_000  # [ns] of the least delays, one is kept
PACE_NS = 1_000_000_000  # [ns] shorter logs tell none
RESTART_NS = 1_000_000_000  # [ns] a stamp that goes back by more is of a board that started again


class BoardOffset:
    """Hear every stamp first, then ask. Stamps of a board that starts again are a new piece."""

    def __init__(self) -> None:
        self._pieces: list[dict[int, tuple[Ns, Ns]]] = []  # bin → stamp, offset
        self._newest: Ns = 0
        self._since: tuple[Ns, Ns] = (0, 0)  # stamp, arrival
        self._until: tuple[Ns, Ns] = (0, 0)
        self._paces: list[float] = []
        self._hulls: list[list[tuple[Ns, Ns]]] = []
        self._piece = 0
        self._asked: Ns | None = None

    @property
    def restarts(self) -> int:
        return max(0, len(self._pieces) - 1)

    def hear(self, stamp: Ns, arrival: Ns) -> None:
        if not self._pieces or stamp < self._newest - RESTART_NS:
            self._pieces.append({})
            self._newest = stamp
            self._since = stamp, arrival
        elif arrival - self._since[1] >= BIN_NS:
            self._paces.append((stamp - self._since[0]) / (arrival - self._since[1]))
            self._since = stamp, arrival
        self._until = stamp, arrival
        self._newest = max(self._newest, stamp)
        piece, offset = self._pieces[-1], arrival - stamp
        least = piece.get(stamp // BIN_NS)
        if least is None or offset < least[1]:
            piece[stamp // BIN_NS] = (stamp, offset)

    @property
    def pace(self) -> float | None:
        """[-] Of the stamps by the logger's clock, in the middle; None: too short to tell."""
        if self._paces:
            return median(self._paces)
        (stamp, arrival), (last, until) = self._since, self._until
        return (last - stamp) / (until - arrival) if until - arrival >= PACE_NS else None

    def logger_ns(self, stamp: Ns) -> Ns:
        """[ns] By the logger's clock. Ask in the order in which the stamps were heard."""
        if not self._hulls:
            self._hulls = [_lower_hull(sorted(piece.values())) for piece in self._pieces]
        if self._asked is not None and stamp < self._asked - RESTART_NS:
            self._piece = min(self._piece + 1, len(self._hulls) - 1)
            self._asked = stamp
        self._asked = stamp if self._asked is None else max(self._asked, stamp)
        return stamp + _at(self._hulls[self._piece], stamp)


def _lower_hull(points: list[tuple[Ns, Ns]]) -> list[tuple[Ns, Ns]]:
    """Monotone chain (Andrew 1979): convex from below."""
    hull: list[tuple[Ns, Ns]] = []
    for point in points:
        while len(hull) > 1 and _turns_down(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    return hull


def _turns_down(a: tuple[Ns, Ns], b: tuple[Ns, Ns], c: tuple[Ns, Ns]) -> bool:
    return (b[1] - a[1]) * (c[0] - a[0]) >= (c[1] - a[1]) * (b[0] - a[0])


def _at(hull: list[tuple[Ns, Ns]], stamp: Ns) -> Ns:
    """[ns] Offset between two corners; before the first and after the last that of the corner."""
    above = bisect_right(hull, stamp, key=lambda corner: corner[0])
    if above == 0 or above == len(hull):
        return hull[min(above, len(hull) - 1)][1]
    (t0, low), (t1, high) = hull[above - 1], hull[above]
    return low + round((high - low) * (stamp - t0) / (t1 - t0))
