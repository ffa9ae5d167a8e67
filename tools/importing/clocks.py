"""Clocks of a log: the logger's, which never goes backwards in a recording, and a board's against
it. Pure."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from statistics import median

from messages.units import Ns
from services.runtime.config.errors import LindyError

S = 1_000_000_000  # [ns]
STEP_NS = S  # [ns] of the logger's clock backwards; less is the order in which it wrote
YEAR_2000_NS = 946_684_800 * S  # [ns] UTC; an earlier clock was never set
LONGEST_PAUSE_NS = 86_400 * S  # [ns] a longer one is a clock that was set in mid-log
BIN_NS = 5 * S  # [ns] of the least delays, one is kept
PACE_NS = S  # [ns] shorter logs tell none
RESTART_NS = S  # [ns] a stamp that goes back by more is of a board that started again


class LoggerClock:
    """Arrivals as the recording has them: never backwards. Where the logger's clock steps back,
    everything after it is moved, so that time goes on."""

    def __init__(self, began_ns: Ns | None = None) -> None:
        """
        Args:
            began_ns: [ns] UTC of the first row; None: as the log says.
        """
        self.first_ns: Ns | None = None
        self.last_ns: Ns = 0
        self.shift_ns: Ns = 0  # what was added
        self.steps: list[tuple[float, float]] = []  # [s] when, and how far back
        self._began = began_ns

    def arrival(self, said: Ns) -> Ns:
        """[ns] UTC.

        Raises:
            LindyError: the clock was never set, or was set in mid-log.
        """
        if self.first_ns is None:
            if self._began is not None:
                self.shift_ns = self._began - said
            elif said < YEAR_2000_NS:
                raise LindyError(
                    f"its clock says {said / 1e9:.0f} s after 1 January 1970, so it was never set; "
                    f"write began = 2024-05-01T09:30:00Z (when it was, UTC) in the map"
                )
            self.first_ns = self.last_ns = said + self.shift_ns
        at = said + self.shift_ns
        if at < self.last_ns - STEP_NS:
            self.steps.append((self.elapsed_s, (self.last_ns - at) / 1e9))
            self.shift_ns += self.last_ns - at
            at = self.last_ns
        if at > self.last_ns + LONGEST_PAUSE_NS:
            raise LindyError(
                f"its clock jumps by {(at - self.last_ns) / 86_400e9:.0f} days after "
                f"{self.elapsed_s:.1f} s: it was set in mid-log, or these are two logs; "
                f"cut the log there"
            )
        self.last_ns = max(self.last_ns, at)
        return self.last_ns

    @property
    def elapsed_s(self) -> float:
        """[s] Since the first row."""
        return 0.0 if self.first_ns is None else (self.last_ns - self.first_ns) / 1e9


def by_logger(stamps: Sequence[Ns], arrivals: Sequence[Ns]) -> list[Ns]:
    """[ns] A board's stamps by the logger's clock: none after its arrival.

    The offset (arrival - stamp) is never below the true difference of the clocks, and now and then
    a message comes without delay. So the difference is the lower convex hull of all offsets:
    straight while both crystals are even, and never above any of them.
    """
    found: list[Ns] = []
    for piece in _pieces(stamps):
        least: dict[int, tuple[Ns, Ns]] = {}  # bin → stamp, offset
        for stamp, arrival in zip(stamps[piece], arrivals[piece], strict=True):
            before = least.get(stamp // BIN_NS)
            if before is None or arrival - stamp < before[1]:
                least[stamp // BIN_NS] = (stamp, arrival - stamp)
        hull = _lower_hull(sorted(least.values()))
        found += [stamp + _at(hull, stamp) for stamp in stamps[piece]]
    return found


def pace(stamps: Sequence[Ns], arrivals: Sequence[Ns]) -> float | None:
    """[-] Of a board's stamps by the logger's clock, in the middle; None: too short to tell."""
    paces: list[float] = []
    begin = 0
    for piece in _pieces(stamps):
        begin = since = piece.start
        for k in range(piece.start, piece.stop):
            if (seconds := arrivals[k] - arrivals[since]) >= BIN_NS:
                paces.append((stamps[k] - stamps[since]) / seconds)
                since = k
    if paces:
        return median(paces)
    seconds = arrivals[-1] - arrivals[begin] if arrivals else 0
    return (stamps[-1] - stamps[begin]) / seconds if seconds >= PACE_NS else None


def _pieces(stamps: Sequence[Ns]) -> Iterator[slice]:
    """From each start of the board to the next."""
    begin, newest = 0, stamps[0] if stamps else 0
    for k, stamp in enumerate(stamps):
        if stamp < newest - RESTART_NS:
            yield slice(begin, k)
            begin, newest = k, stamp
        newest = max(newest, stamp)
    if stamps:
        yield slice(begin, len(stamps))


def _lower_hull(points: list[tuple[Ns, Ns]]) -> list[tuple[Ns, Ns]]:
    """Monotone chain (Andrew 1979): convex from below."""
    hull: list[tuple[Ns, Ns]] = []
    for c in points:
        while len(hull) > 1:
            a, b = hull[-2:]
            if (b[1] - a[1]) * (c[0] - a[0]) < (c[1] - a[1]) * (b[0] - a[0]):
                break
            hull.pop()
        hull.append(c)
    return hull


def _at(hull: list[tuple[Ns, Ns]], stamp: Ns) -> Ns:
    """[ns] Offset between two corners; before the first and after the last that of the corner."""
    above = bisect_right(hull, stamp, key=lambda corner: corner[0])
    if above == 0 or above == len(hull):
        return hull[min(above, len(hull) - 1)][1]
    (t0, low), (t1, high) = hull[above - 1], hull[above]
    return low + round((high - low) * (stamp - t0) / (t1 - t0))
