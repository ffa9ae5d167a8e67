"""Log lines for the pilot: in plain words, with their time; a repeated line is shown once, and a
warning or an error again when it comes back."""

import re
from collections import OrderedDict
from collections.abc import Sequence
from typing import NamedTuple

from messages.health import LogLine
from messages.text import harmless

MOST = 200  # different lines that are kept; beyond that the oldest are dropped
KEPT = 3  # newest warnings and errors that stay on the screen
ABSENT_NS = 10_000_000_000  # [ns] a warning that comes again after this has come back
NUMBER = re.compile(r"\d+(\.\d+)?")  # lines that differ in numbers alone are the same line


class LogEntry(NamedTuple):
    """A line, and how often it came. Times [s] since the drone was first armed; None: before."""

    line: LogLine  # the newest of them
    times: int
    first_s: float | None
    last_s: float | None
    back: bool = False  # it has come back: its newest time is what matters


class PrintedEntry(NamedTuple):
    """When a line was printed last."""

    times: int  # that it had come
    stamp_ns: int
    pause_ns: int = ABSENT_NS  # [ns] until it is printed when it comes back; doubles


class LogLines:
    """Every different line of a dive, the newest last."""

    def __init__(self) -> None:
        self._entries: OrderedDict[tuple[str, ...], LogEntry] = OrderedDict()
        self._printed: dict[tuple[str, ...], PrintedEntry] = {}

    def add(self, line: LogLine, at_s: float | None) -> LogEntry | None:
        """A line has arrived. Returns it if it is to be printed now: for the first, tenth,
        hundredth … time, and a warning or an error that has come back. `unprinted` has the rest, so
        that no line floods the terminal."""
        key = (line.service, line.level, NUMBER.sub("#", line.text))
        at_s = None if at_s is None or at_s < 0.0 else at_s
        before = self._entries.pop(key, None)
        if before is None:
            entry = LogEntry(line, 1, at_s, at_s)
        else:
            entry = LogEntry(line, before.times + 1, before.first_s, at_s)
        self._entries[key] = entry
        if len(self._entries) > MOST:
            dropped, _ = self._entries.popitem(last=False)
            self._printed.pop(dropped, None)
        printed = self._printed.get(key)
        if before is not None and printed is not None and _back(before, line, printed):
            pause_ns = 2 * printed.pause_ns
            self._printed[key] = PrintedEntry(entry.times, line.stamp_ns, pause_ns)
            return entry._replace(back=True)
        if str(entry.times).rstrip("0") != "1":
            return None
        pause_ns = ABSENT_NS if printed is None else printed.pause_ns
        self._printed[key] = PrintedEntry(entry.times, line.stamp_ns, pause_ns)
        return entry

    def newest(self, most: int) -> list[LogEntry]:
        return newest(list(self._entries.values()), most)

    def unprinted(self) -> list[LogEntry]:
        """Warnings and errors that were repeated since they were printed last. Information that is
        printed after the dive would only look out of order."""
        return [
            entry
            for key, entry in self._entries.items()
            if entry.line.level != "info"
            and (key not in self._printed or entry.times != self._printed[key].times)
        ]


def newest(entries: Sequence[LogEntry], most: int) -> list[LogEntry]:
    """The newest, in their order. Warnings and errors are not pushed out by what is only
    information: the last `KEPT` of them are among these, however old they are."""
    numbers = range(len(entries))
    warnings = [n for n in numbers if entries[n].line.level != "info"]
    first = [*reversed(warnings[-KEPT:]), *reversed(numbers)]
    shown = set(list(dict.fromkeys(first))[:most])
    return [entries[n] for n in sorted(shown)]


def _back(before: LogEntry, line: LogLine, printed: PrintedEntry) -> bool:
    """Is it a warning or an error that was absent, and not printed for a while? By its sender's
    clock, which is there before arming too; it begins anew with its computer."""
    absent_ns = abs(line.stamp_ns - before.line.stamp_ns)
    unprinted_ns = abs(line.stamp_ns - printed.stamp_ns)
    return line.level != "info" and absent_ns > ABSENT_NS and unprinted_ns > printed.pause_ns


def full(entry: LogEntry) -> str:
    """A line where there is no screen."""
    line = entry.line
    if entry.back:
        again = f" (again, {entry.times} times in all)"
        return f"{line.level:<7} {when(entry.last_s):>8}  {printable(line)}{again}"
    again = "" if entry.times == 1 else f" ({entry.times} times, last {_at(entry.last_s)})"
    return f"{line.level:<7} {when(entry.first_s):>8}  {printable(line)}{again}"


def brief(entry: LogEntry) -> str:
    """A line of the screen: what matters comes first, because the end may be cut."""
    again = "" if entry.times == 1 else f"{entry.times} × "
    return f"{when(entry.last_s):>8}  {again}{printable(entry.line)}"


def printable(line: LogLine) -> str:
    """Service and text, in one line: anybody on the bus may have sent them."""
    return harmless(f"{line.service}: {line.text}").replace("\n", "�")


def when(at_s: float | None) -> str:
    return "start" if at_s is None else f"{at_s:.1f} s"


def _at(at_s: float | None) -> str:
    return "before arming" if at_s is None else f"at {at_s:.1f} s"
