"""Clocks of a log: the logger's, which never goes backwards in a recording, and a board's against
it. Pure."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from statistics import median

from messages.units import Ns
from tools.importing.log_file import BY_FILE, EARLIEST_NS

S = 1_000_000_000  # [ns]
STEP_NS = S  # [ns] of the logger's clock backwards; less is the order in which it wrote
LONGEST_PAUSE_NS = 86_400 * S  # [ns] a longer one is a clock that was set in mid-log
SET_NS = 60 * S  # [ns] by which it differs from the time since a board began: it was set
SHORTEST_NS = S // 2  # [ns] a clock that went on for less is a damaged time
BIN_NS = 5 * S  # [ns] of the least delays, one is kept
PACE_NS = S  # [ns] shorter logs tell none
SET = "its clock was set while it was written: all times are by the clock that is latest"
RESTART_NS = S  # [ns] a stamp that goes back by more is of a board that started again


class LoggerClock:
    """Arrivals as the recording has them: never backwards. Where the logger's clock is set, back or
    ahead, everything after it is moved, so that time goes on as the clock of a board does, or else
    at once. The date is by the clock that is latest."""

    def __init__(self, began_ns: Ns | None = None, changed_ns: Ns = 0) -> None:
        """
        Args:
            began_ns: [ns] UTC of the first row; None: as the log says.
            changed_ns: [ns] UTC of the last row, of a log whose clock was never set.
        """
        self.first_ns: Ns | None = None
        self.last_ns: Ns = 0
        self.shifts: list[Ns] = [0]  # [ns] what was added, since each time that the clock was set
        self.set_at: list[tuple[float, float]] = []  # [s] when, and how far
        self._spans: list[list[Ns]] = []  # [ns] arrivals at each of them, the first and the last
        self._boot: tuple[Ns, Ns] | None = None  # [ns] of a board, and arrival
        self._period: Ns = 0  # [ns] between rows; longer than a step, it does not tell
        self._began, self._changed = began_ns, changed_ns

    def arrival(self, said: Ns, boot_ns: Ns | None = None) -> Ns:
        """[ns] Of a row, by its first clock; with `moved_ns`, known at the end, it is UTC.

        Args:
            said: [ns] by the logger.
            boot_ns: [ns] since the board began that sent it, if it says so.
        """
        at = said + self.shifts[-1]
        if self.first_ns is None:
            self.first_ns = self.last_ns = at
            self._spans.append([at, at])
        later = at - self.last_ns
        by_board: Ns | None = None  # [ns] how much later it is
        if boot_ns is not None and self._boot is not None and boot_ns >= self._boot[0]:
            by_board = self._boot[1] + boot_ns - self._boot[0] - self.last_ns
        if not -STEP_NS <= later <= LONGEST_PAUSE_NS or (
            by_board is not None and abs(later - by_board) > SET_NS
        ):
            goes_on = self._period if by_board is None else max(0, by_board)
            self.set_at.append((self.elapsed_s, (later - goes_on) / 1e9))
            at = self.last_ns + goes_on
            self.shifts.append(at - said)
            self._spans.append([at, at])
        elif 0 < later < STEP_NS:
            self._period = later
        self.last_ns = self._spans[-1][1] = max(self.last_ns, at)
        if boot_ns is not None:
            self._boot = boot_ns, self.last_ns
        return self.last_ns

    @property
    def moved_ns(self) -> Ns:
        """[ns] What makes UTC of arrivals."""
        if self.first_ns is None:
            return 0
        if self._began is not None:
            return self._began - self.first_ns
        return self._changed - self.last_ns if self._never_set else -min(self._lasting())

    @property
    def remarks(self) -> list[str]:
        """What a reader of the recording should know of its times."""
        if self._began is not None or self.first_ns is None:
            return []
        return [BY_FILE] if self._never_set else [SET] if min(self._lasting()) < 0 else []

    @property
    def _never_set(self) -> bool:
        return self.last_ns - min(self._lasting()) < EARLIEST_NS

    def _lasting(self) -> list[Ns]:
        """Shifts of clocks that went on for a while."""
        each = zip(self.shifts, self._spans, strict=True)
        return [shift for shift, (begin, end) in each if end - begin >= SHORTEST_NS] or self.shifts

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
