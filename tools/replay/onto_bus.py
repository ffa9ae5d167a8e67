"""`lindy replay FILE`: a recorded dive onto a bus, in its own time."""

import os
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
from tools.replay.play_clock import PlayClock
from tools.replay.publishing import Republisher, require_heard
from tools.replay.source import ReplaySource
from tools.replay.terminal import HELP, Terminal, terminal
from tools.replay.viewing import viewer

STEP_NS, FAR_NS = 5_000_000_000, 30_000_000_000  # [ns] of the arrow keys
LOOK_S = 0.05  # [s] between two looks at keys and signals
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
    """Play until the end, Ctrl-C or q. Returns the exit status.

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
        shown = exits.enter_context(terminal())
        return Replay(source, wish, bus, shown).play(lambda: stop.asked)


class Replay:
    """One replay onto a bus."""

    def __init__(self, source: ReplaySource, wish: Wish, bus: Bus, shown: Terminal) -> None:
        self._source, self._wish, self._shown = source, wish, shown
        self._out = Republisher(source.recording, bus.forward)
        self._clock = PlayClock(*wish.span, wish.speed, time.monotonic_ns())
        self._behind = 0  # times that it was too slow
        self._quit = False
        self._wanted: dict[str, bool] = {}
        self._rows = self._from(self._clock.begin)
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
        self._clock.jump(self._clock.begin, time.monotonic_ns())
        while not stopped() and not self._quit and self._turn():
            pass
        self._shown.end()
        print(harmless(self._end()), flush=True)
        return 0

    def _turn(self) -> bool:
        """Send what is due and wait for the next. False: it is over."""
        now = time.monotonic_ns()
        self._send_due(now)
        if self._clock.over(now) and self._next is None:
            if not self._wish.loop:
                return False
            self._go_to(self._clock.begin)
        self._shown.status(self._status(now))
        for key in self._shown.wait(self._idle_s(time.monotonic_ns())):
            self._press(key)
        return True

    def _send_due(self, now: int) -> None:
        clock, row = self._clock, self._next
        position = clock.position(now)
        if row is not None and clock.playing and now - clock.due(row.log_ns) > BEHIND_NS:
            self._behind += 1
            clock.jump(row.log_ns, now)
            position = row.log_ns
        while row is not None and row.log_ns <= position:
            self._out.send(row, clock.due(row.log_ns))
            row = next(self._rows, None)
        self._next = row

    def _idle_s(self, now: int) -> float:
        if self._next is None or not self._clock.playing:
            return LOOK_S
        return max(0.0, min(LOOK_S, (self._clock.due(self._next.log_ns) - now) / 1e9))

    def _press(self, key: str) -> None:
        now = time.monotonic_ns()
        here = self._clock.position(now)
        jumps = {"back": -STEP_NS, "on": STEP_NS, "back_far": -FAR_NS, "on_far": FAR_NS}
        if key == "pause":
            self._clock.toggle(now)
        elif key == "quit":
            self._quit = True
        else:
            self._go_to(here + jumps[key])

    def _go_to(self, position: int) -> None:
        """Go on from there. A file is read from its beginning again."""
        begin = min(self._clock.end, max(self._clock.begin, position))
        self._rows = self._from(begin)
        self._next = next(self._rows, None)
        self._clock.jump(begin, time.monotonic_ns())

    def _from(self, begin: int) -> Iterator[Raw]:
        end = self._wish.span[1]
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
        keys = f"; {HELP}" if self._shown.interactive else ""
        return (
            f"replay of {self._source.path}: {self._source.vehicle}, {(end - begin) / 1e9:.1f} s "
            f"at ×{self._wish.speed:g}{loop}{keys}"
        )

    def _status(self, now: int) -> str:
        first, (_, end) = self._source.origin_ns, self._wish.span
        here = (self._clock.position(now) - first) / 1e9
        state = "playing" if self._clock.playing else "paused "
        return f"{here:8.1f} / {(end - first) / 1e9:.1f} s  ×{self._wish.speed:g}  {state}"

    def _end(self) -> str:
        behind = f"; it was too slow {self._behind} times" if self._behind else ""
        unread = sum(self._source.recording.unreadable.values())
        lost = f"; {unread} messages could not be read" if unread else ""
        return f"{self._out.sent} messages of {len(self._out.keys)} topics{lost}{behind}"
