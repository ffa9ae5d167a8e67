"""`lindy replay FILE`: a recorded dive onto a bus, in its own time."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from messages.text import harmless
from services.runtime.bus.envelope import Bus
from services.runtime.bus.zenoh_bus import listening, open_bus
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import REPLAY
from tools.live.stop_signals import StopSignals
from tools.recordings.recording import Raw
from tools.replay.publishing import Republisher, require_heard
from tools.replay.source import ReplaySource
from tools.replay.viewing import viewer

LOOK_S = 0.05  # [s] between two looks at signals
CLEAR = "\r\x1b[K"  # the whole line of a terminal
BEHIND_NS = 250_000_000  # [ns] later than this, the replay goes on from where it is
DISPLAYS = {"DISPLAY", "WAYLAND_DISPLAY"}


@dataclass(frozen=True, slots=True)
class Wish:
    """What is to be played, and how."""

    span: tuple[int, int]  # [ns UTC] recorded, both included
    speed: float = 1.0
    loop: bool = False
    patterns: tuple[str, ...] = ()  # of keys; none: all


def onto_bus(
    source: ReplaySource,
    wish: Wish,
    *,
    connect: str | None,
    listen: str | None,
    headless: bool,
) -> int:
    """Play until the end or Ctrl-C. Returns the exit status.

    Raises:
        LindyError: the hub lets no replay through, or nothing can be played.
    """
    space = f"{REPLAY}/{source.vehicle}"
    with ExitStack() as exits:
        stop = exits.enter_context(StopSignals())
        folder = Path(exits.enter_context(TemporaryDirectory(prefix="lindy-")))
        endpoint = connect or listen or f"unixsock-stream/{folder}/hub.sock"
        if connect is None:
            exits.enter_context(listening(endpoint))
        bus = exits.enter_context(open_bus(endpoint, space))
        with open_bus(endpoint, space) as listener:
            require_heard(endpoint, bus, listener, source.path.name)
        if not headless and DISPLAYS & os.environ.keys() and find_spec("rerun"):
            exits.enter_context(viewer(exits.enter_context(source.stack()), endpoint))
        return Replay(source, wish, bus).play(lambda: stop.asked)


class Replay:
    """One replay onto a bus."""

    def __init__(self, source: ReplaySource, wish: Wish, bus: Bus) -> None:
        self._source, self._wish = source, wish
        self._out = Republisher(source.recording, bus.forward)
        self._behind = 0  # times that it was too slow
        self._wanted: dict[str, bool] = {}
        self._shows = sys.stdout.isatty()
        self._at, self._since = wish.span[0], 0  # [ns] recorded time, and the real time it was at
        self._rows = self._from_the_beginning()
        self._next = next(self._rows, None)

    def play(self, stopped: Callable[[], bool]) -> int:
        """
        Args:
            stopped: does the user want it to end?

        Raises:
            LindyError: there is nothing to play.
        """
        if self._next is None:
            raise LindyError(f"{self._source.path}: nothing of what is asked for is in it")
        print(harmless(self._beginning()), flush=True)
        self._since = time.monotonic_ns()
        while not stopped() and self._turn():
            pass
        if self._shows:
            print(flush=True)
        print(harmless(self._end()), flush=True)
        return 0

    def _turn(self) -> bool:
        """Send what is due and wait for the next. False: it is over."""
        now = time.monotonic_ns()
        self._send_due(now)
        if self._next is None and self._position(now) >= self._wish.span[1]:
            if not self._wish.loop:
                return False
            self._at, self._since = self._wish.span[0], now
            self._rows = self._from_the_beginning()
            self._next = next(self._rows, None)
        if self._shows:
            print(f"{CLEAR}{self._status(now)}", end="", flush=True)
        time.sleep(self._idle_s(time.monotonic_ns()))
        return True

    def _position(self, now: int) -> int:
        """[ns] Recorded time, at most the end."""
        gone = round((now - self._since) * self._wish.speed)
        return min(self._wish.span[1], self._at + gone)

    def _due(self, recorded: int) -> int:
        """[ns] When a recorded time is reached, so that a message's age is as it was."""
        return self._since + round((recorded - self._at) / self._wish.speed)

    def _send_due(self, now: int) -> None:
        row = self._next
        if row is not None and now - self._due(row.log_ns) > BEHIND_NS:
            self._behind += 1
            self._at, self._since = row.log_ns, now
        position = self._position(now)
        while row is not None and row.log_ns <= position:
            self._out.send(row, self._due(row.log_ns))
            row = next(self._rows, None)
        self._next = row

    def _idle_s(self, now: int) -> float:
        if self._next is None:
            return LOOK_S
        return max(0.0, min(LOOK_S, (self._due(self._next.log_ns) - now) / 1e9))

    def _from_the_beginning(self) -> Iterator[Raw]:
        begin, end = self._wish.span
        for raw in self._source.raw():
            if begin <= raw.log_ns <= end and self._wants(raw.key):
                yield raw

    def _wants(self, key: str) -> bool:
        if key not in self._wanted:
            patterns = self._wish.patterns
            self._wanted[key] = not patterns or any(fnmatchcase(key, p) for p in patterns)
        return self._wanted[key]

    # What is said.

    def _beginning(self) -> str:
        begin, end = self._wish.span
        loop = ", over and over" if self._wish.loop else ""
        return (
            f"replay of {self._source.path}: {self._source.vehicle}, {(end - begin) / 1e9:.1f} s "
            f"at ×{self._wish.speed:g}{loop}"
        )

    def _status(self, now: int) -> str:
        first, (_, end) = self._source.origin_ns, self._wish.span
        here = (self._position(now) - first) / 1e9
        return f"{here:8.1f} / {(end - first) / 1e9:.1f} s  ×{self._wish.speed:g}"

    def _end(self) -> str:
        behind = f"; it was too slow {self._behind} times" if self._behind else ""
        unread = sum(self._source.recording.unreadable.values())
        lost = f"; {unread} messages could not be read" if unread else ""
        return f"{self._out.sent} messages of {len(self._out.keys)} topics{lost}{behind}"
