"""What a log says, as columns: each of our messages from one of its sources, by two clocks: the
logger's, which never goes backwards in a recording, and a board's against it. Pure."""

from array import array
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from math import asin, atan2, nan
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.units import Ns, Quaternion, Vec3
from services.marine.attitude import to_world
from services.marine.mounting import ALONG, Rotation
from services.runtime.config.errors import LindyError
from tools.importing.log_file import BY_FILE, EARLIEST_NS, BlankError
from tools.importing.map_file import (
    QUANTITIES,
    STAMP_UNITS,
    TARGETS,
    VECTOR,
    WORLDS,
    FieldMap,
    TakenMessage,
)

S = 1_000_000_000  # [ns]
STEP_NS = S  # [ns] of the logger's clock backwards; less is the order in which it wrote
LONGEST_PAUSE_NS = 86_400 * S  # [ns] a longer one is a clock that was set in mid-log
SHORTEST_NS = S // 2  # [ns] a clock that went on for less is a damaged time
BIN_NS = 5 * S  # [ns] of the least delays, one is kept
PACE_NS = S  # [ns] shorter logs tell none
SET = "its clock was set while it was written: all times are by the clock that is latest"
Floats = NDArray[np.float64]
RESTART_NS = S  # [ns] a stamp that goes back by more is of a board that started again


class LoggerClock:
    """Arrivals as the recording has them: never backwards. Where the logger's clock is set, back or
    ahead by more than a day, everything after it is moved, so that time goes on at once. The date
    is by the clock that is latest."""

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
        self._period: Ns = 0  # [ns] between rows; longer than a step, it does not tell
        self._began, self._changed = began_ns, changed_ns

    def arrival(self, said: Ns) -> Ns:
        """[ns] Of a row, by its first clock; with `moved_ns`, known at the end, it is UTC.

        Args:
            said: [ns] by the logger.
        """
        at = said + self.shifts[-1]
        if self.first_ns is None:
            self.first_ns = self.last_ns = at
            self._spans.append([at, at])
        later = at - self.last_ns
        if not -STEP_NS <= later <= LONGEST_PAUSE_NS:
            self.set_at.append((self.elapsed_s, (later - self._period) / 1e9))
            at = self.last_ns + self._period
            self.shifts.append(at - said)
            self._spans.append([at, at])
        elif 0 < later < STEP_NS:
            self._period = later
        self.last_ns = self._spans[-1][1] = max(self.last_ns, at)
        return self.last_ns

    @property
    def moved_ns(self) -> Ns:
        """[ns] What makes UTC of arrivals."""
        if self.first_ns is None:
            return 0
        if self._began is not None:
            return self._began - self.first_ns
        if self._never_set:
            return self._changed - self.last_ns
        return -min(self._lasting())

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
        first, low = hull[0]
        corners = np.array(hull, np.int64) - hull[0]
        since = np.array(stamps[piece], np.int64) - first
        offsets: Floats = np.interp(since, corners[:, 0], corners[:, 1])
        found += (first + low + since + np.rint(offsets).astype(np.int64)).tolist()
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


LONGEST_WORD = 30  # letters of it that are shown where a number was expected
OTHER_CLOCK_NS = 10_000_000_000  # [ns] between stamp and arrival: they are not by one clock
UNREADABLE = (AttributeError, IndexError, TypeError, ValueError, OverflowError)

Take = Callable[[str], Callable[[Any], Any]]  # by the name of a field: what takes it out of a row's


class LogStream:
    """One of our messages from one source of a log. Hear all rows first, then ask."""

    def __init__(self, source: str, taken: TakenMessage, take: Take) -> None:
        topic = topics.find(taken.as_)
        assert topic is not None, taken.as_
        self.source, self.taken, self.topic = source, taken, topic
        self.known = TARGETS[taken.as_]
        self.rows = array("q")  # their numbers in the log
        self.arrivals = array("q")  # [ns] UTC
        self.stamps = array("q")  # [ns] by the clock that the map says
        self.words: list[dict[str, str | bool] | str] = []  # of a status, or what is odd there
        self._take = take
        self._only = [(take(path), value) for path, value in taken.only.items()]
        self._stamp = take(taken.stamp) if taken.clock != "arrival" else None
        self._getters = {
            name: [take(path) for path in field.from_] if field.value is None else []
            for name, field in taken.fields.items()
        }
        self._numbers = {name: array("d") for name in taken.fields}
        self._there = {name: bytearray() for name in taken.fields}

    def hear(self, number: int, fields: Any, arrival: Ns, shifts: Sequence[Ns] = (0,)) -> None:
        """
        Args:
            number: of the row in the log.
            arrival: [ns] as LoggerClock says.
            shifts: [ns] by which the logger's clock was moved until then, the last one now.

        Raises:
            LindyError: the map does not fit: a field that is not there, a wrong clock.
        """
        try:
            if not all(_is_same(take(fields), value) for take, value in self._only):
                return
        except BlankError:
            return
        except UNREADABLE:
            raise self._without(list(self.taken.only), fields) from None
        self.rows.append(number)
        self.arrivals.append(arrival)
        self.stamps.append(self._stamp_ns(fields, arrival, shifts))
        if self.topic.key == topics.STATUS.key:
            self.words.append(self._words(fields))
        else:
            self._hear_numbers(fields)

    def _hear_numbers(self, fields: Any) -> None:
        whole = True
        for name, getters in self._getters.items():
            is_there, numbers = whole, [nan] * len(getters)
            try:
                if whole:
                    numbers = [float(take(fields)) for take in getters]
            except BlankError:
                is_there, whole = False, not self.known[name].required
            except UNREADABLE:
                raise self._without(self.taken.fields[name].from_, fields) from None
            self._there[name].append(is_there)
            self._numbers[name].extend(numbers)

    def _words(self, fields: Any) -> dict[str, str | bool] | str:
        found: dict[str, str | bool] = {}
        for name, field in self.taken.fields.items():
            try:
                found[name] = _word(self._take(field.from_[0])(fields), field)
            except BlankError:
                continue
            except KeyError as unknown:
                return f"{name} {unknown.args[0]} is not in the map, left out"
            except UNREADABLE:
                raise self._without(field.from_, fields) from None
        return found

    def _stamp_ns(self, fields: Any, arrival: Ns, shifts: Sequence[Ns]) -> Ns:
        if self._stamp is None:
            return arrival
        unit = self.taken.stamp_unit
        try:
            raw = self._stamp(fields)
            if unit == "ros":
                # JSON by Foxglove's schemas has nsec.
                below = raw.nsec if hasattr(raw, "nsec") else raw.nanosec
                stamp = int(raw.sec) * 10**9 + int(below)
            else:
                scale = STAMP_UNITS[unit]
                stamp = raw * scale if isinstance(raw, int) else round(float(raw) * scale)
        except UNREADABLE:
            raise self._without([self.taken.stamp], fields) from None
        if self.taken.clock == "board":
            return stamp
        # What was stamped before the clock was set may arrive behind that.
        stamp += min(shifts[-2:], key=lambda shift: abs(stamp + shift - arrival))
        if abs(stamp - arrival) > OTHER_CLOCK_NS:
            raise LindyError(
                f"{self.source}: {self.taken.stamp} says {_date(stamp)}, and the logger "
                f'{_date(arrival)}: they are not by one clock; write clock = "board" at '
                f'{self.taken.where} in the map, or "arrival" where the stamp is never set'
            )
        return stamp

    def _without(self, paths: Sequence[str], fields: Any) -> LindyError:
        words: list[str] = []
        for path in paths:
            found: Any = None
            try:
                found = self._take(path)(fields)
                float(found)
            except ValueError:  # a word
                words.append(f"{path} is {str(found)[:LONGEST_WORD]!r}")
            except (BlankError, *UNREADABLE):
                continue
        if words:
            return LindyError(
                f"{self.source}: {', '.join(words)}, which is no number; mend the log, or leave "
                f"it out of the map at {self.taken.where}"
            )
        return LindyError(
            f"{self.source} has no number {', '.join(paths)}, which the map names at "
            f"{self.taken.where}; write there the fields that it has"
        )

    # Afterwards.

    def move(self, by_ns: Ns) -> None:
        """Arrivals to UTC."""
        for times in (self.arrivals, *([] if self.taken.clock == "board" else [self.stamps])):
            times[:] = array("q", (np.frombuffer(times, np.int64) + by_ns).tobytes())

    def stamps_ns(self) -> Sequence[Ns]:
        """(n,) [ns] UTC by the logger's clock."""
        board = self.taken.clock == "board"
        return by_logger(self.stamps, self.arrivals) if board else self.stamps

    def is_there(self, name: str) -> NDArray[np.bool_]:
        """(n,) Does the row have this field?"""
        return np.frombuffer(self._there[name], bool)

    def raw(self, name: str) -> Floats:
        """(n, k) In the log's own numbers."""
        numbers = np.frombuffer(self._numbers[name], float)
        return numbers.reshape(len(self.rows), len(self._getters[name]))

    def column(self, name: str) -> Floats:
        """(n, k) [SI, FRD]"""
        field = self.taken.fields[name]
        known = self.known[name]
        factor = QUANTITIES[known.quantity].units.get(field.unit, 1.0)
        if field.value is not None:
            return np.full((len(self.rows), 1), field.value * factor)
        if field.full is not None:
            factor = 1.0 / (field.full - field.zero)
        raw = self.raw(name)
        if field.curve:
            x, y = zip(*field.curve, strict=True)
            along: Floats = np.interp(raw, x, y)
            return along * factor
        scaled = (raw - field.zero) * factor
        if known.size != VECTOR or self.taken.rotation == ALONG:
            return scaled
        x, y, z = scaled.T
        return np.column_stack([a * x + b * y + c * z for a, b, c in self.taken.rotation])

    def angles(self, q: Quaternion) -> tuple[float, float, float]:
        """[rad] Roll, pitch and heading of an attitude in the log's axes of body and world."""
        # The body's axes (FRD) in the world's (NED): R = world R(q) bodyᵀ, column by column.
        world = WORLDS[self.taken.world]
        body = self.taken.rotation
        forward, starboard, down = (_turned(world, to_world(q, axis)) for axis in body)
        pitch = -asin(max(-1.0, min(1.0, forward[2])))
        return atan2(starboard[2], down[2]), pitch, atan2(forward[1], forward[0])


def _is_same(raw: Any, wanted: Any) -> bool:
    """Also a word of a table that means it: `True` or `true`, 1 or "1"."""
    words = [f"{each:g}" if isinstance(each, float) else str(each) for each in (raw, wanted)]
    return bool(raw == wanted) or words[0].casefold() == words[1].casefold()


def _word(raw: Any, field: FieldMap) -> str | bool:
    """
    Raises:
        KeyError: `values` does not have it.
    """
    if field.mask is not None:
        return int(raw) & field.mask != 0
    if not field.values:
        return bool(raw)
    return field.values[raw if isinstance(raw, str) else f"{float(raw):g}"]


def _turned(rotation: Rotation, v: Vec3) -> Vec3:
    x, y, z = (a * v[0] + b * v[1] + c * v[2] for a, b, c in rotation)
    return x, y, z


def _date(utc_ns: Ns) -> str:
    try:
        date = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=utc_ns / 1e9)
        return f"{date:%Y-%m-%d %H:%M:%S}"
    except OverflowError:
        return f"{utc_ns / 1e9:g} s"
