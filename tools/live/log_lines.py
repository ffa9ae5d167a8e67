"""Log lines as a pilot reads them: in plain words, with their time, a repeated one once."""

import re
from collections import OrderedDict
from typing import NamedTuple

from messages.counts import in_words
from messages.health import LogLine

MOST = 200  # different lines that are kept; of more, those not heard for longest are let go
NUMBER = re.compile(r"\d+(\.\d+)?")  # lines that differ in numbers alone are the same line


class Told(NamedTuple):
    """A line, and how often it came. Times [s] since the drone was first armed; None: before."""

    line: LogLine  # the newest of them
    times: int
    first_s: float | None
    last_s: float | None


class LogLines:
    """Every different line of a dive, the newest last."""

    def __init__(self) -> None:
        self._told: OrderedDict[tuple[str, ...], Told] = OrderedDict()
        self._said: dict[tuple[str, ...], int] = {}  # times when it was said last

    def add(self, line: LogLine, at_s: float | None) -> Told | None:
        """A line has come. Returns it where it is to be said at once: when it comes for the first,
        tenth, hundredth … time. The rest is said by `unsaid`, so that nothing floods a terminal."""
        key = (line.service, line.level, NUMBER.sub("#", line.text))
        at_s = None if at_s is None or at_s < 0.0 else at_s
        before = self._told.pop(key, None)
        if before is None:
            told = Told(line, 1, at_s, at_s)
        else:
            told = Told(line, before.times + 1, before.first_s, at_s)
        self._told[key] = told
        if len(self._told) > MOST:
            gone, _ = self._told.popitem(last=False)
            self._said.pop(gone, None)
        if str(told.times).rstrip("0") != "1":
            return None
        self._said[key] = told.times
        return told

    def newest(self, most: int) -> list[Told]:
        return list(self._told.values())[-most:]

    def unsaid(self) -> list[Told]:
        """Lines that came again since they were said last."""
        return [told for key, told in self._told.items() if told.times != self._said.get(key)]


def full(told: Told) -> str:
    """A line where there is no screen."""
    line = told.line
    again = "" if told.times == 1 else f" ({told.times} times, last {_at(told.last_s)})"
    return f"{line.level:<7} {when(told.first_s):>8}  {line.service}: {in_words(line.text)}{again}"


def brief(told: Told) -> str:
    """A line of the screen: what matters comes first, for the end may be cut."""
    again = "" if told.times == 1 else f"{told.times} × "
    return f"{when(told.last_s):>8}  {again}{told.line.service}: {in_words(told.line.text)}"


def when(at_s: float | None) -> str:
    return "start" if at_s is None else f"{at_s:.1f} s"


def _at(at_s: float | None) -> str:
    return "before arming" if at_s is None else f"at {at_s:.1f} s"
