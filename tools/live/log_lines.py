"""Log lines for the pilot: in plain words, with their time; a repeated line is shown once."""

import re
from collections import OrderedDict
from typing import NamedTuple

from messages.counts import in_words
from messages.health import LogLine

MOST = 200  # different lines that are kept; beyond that the oldest are dropped
NUMBER = re.compile(r"\d+(\.\d+)?")  # lines that differ in numbers alone are the same line


class LogEntry(NamedTuple):
    """A line, and how often it came. Times [s] since the drone was first armed; None: before."""

    line: LogLine  # the newest of them
    times: int
    first_s: float | None
    last_s: float | None


class LogLines:
    """Every different line of a dive, the newest last."""

    def __init__(self) -> None:
        self._entries: OrderedDict[tuple[str, ...], LogEntry] = OrderedDict()
        self._printed: dict[tuple[str, ...], int] = {}  # times when it was printed last

    def add(self, line: LogLine, at_s: float | None) -> LogEntry | None:
        """A line has arrived. Returns it if it is to be printed now: for the first, tenth,
        hundredth … time. `unprinted` has the rest, so that no line floods the terminal."""
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
        if str(entry.times).rstrip("0") != "1":
            return None
        self._printed[key] = entry.times
        return entry

    def newest(self, most: int) -> list[LogEntry]:
        return list(self._entries.values())[-most:]

    def unprinted(self) -> list[LogEntry]:
        """Lines that were repeated since they were printed last, without information from before
        arming: the countdown of the calibration is of no use any more."""
        return [
            entry
            for key, entry in self._entries.items()
            if entry.times != self._printed.get(key)
            and not (entry.line.level == "info" and entry.last_s is None)
        ]


def full(entry: LogEntry) -> str:
    """A line where there is no screen."""
    line = entry.line
    again = "" if entry.times == 1 else f" ({entry.times} times, last {_at(entry.last_s)})"
    return f"{line.level:<7} {when(entry.first_s):>8}  {printable(line)}{again}"


def brief(entry: LogEntry) -> str:
    """A line of the screen: what matters comes first, because the end may be cut."""
    again = "" if entry.times == 1 else f"{entry.times} × "
    return f"{when(entry.last_s):>8}  {again}{printable(entry.line)}"


def printable(line: LogLine) -> str:
    """Service and text without control characters: anybody on the bus may have sent them, and a
    terminal would obey them."""
    text = f"{line.service}: {in_words(line.text)}"
    return "".join(sign if sign.isprintable() else "�" for sign in text)


def when(at_s: float | None) -> str:
    return "start" if at_s is None else f"{at_s:.1f} s"


def _at(at_s: float | None) -> str:
    return "before arming" if at_s is None else f"at {at_s:.1f} s"
