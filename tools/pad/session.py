"""Reads a pad until the user or the time ends it, and shows it: on a terminal ten times a second,
elsewhere once a second."""

import select
import sys
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.live import Live
from rich.text import Text

from services.gamepad.core import PadProfile
from services.runtime.config.errors import LindyError
from tools.pad.meaning import lines
from tools.pad.teaching import Teaching, asked

READ_S = 0.02  # [s]
SCREEN_S, LINES_S = 0.1, 1.0  # [s] on a terminal, elsewhere
Show = Callable[[float, Callable[[], list[str]]], None]


class AnyPad(Protocol):
    name: str

    @property
    def events_hz(self) -> float: ...

    def read(self, now_s: float) -> dict[str, float]: ...


def show(pad: AnyPad, profile: PadProfile, seconds: float | None) -> None:
    """Until `seconds` are over; None: until Ctrl-C."""
    with shown() as put:
        for now_s in _readings(seconds):
            controls = pad.read(now_s)
            put(now_s, lambda c=controls: lines(pad.name, c, pad.events_hz, profile))


def teach(pad: AnyPad, base: PadProfile, seconds: float | None) -> PadProfile:
    """Ask for every action in turn.

    Raises:
        LindyError: the time was over before the last one.
    """
    teaching = Teaching(base)
    with shown() as put:
        for now_s in _readings(seconds):
            controls = pad.read(now_s)
            teaching = teaching.keep() if _entered() else teaching.read(controls)
            if teaching.step is None:
                return teaching.profile()
            put(now_s, lambda c=controls, t=teaching: _asking(pad, c, t))
    raise LindyError("--seconds ended before the last action; nothing was written")


def _asking(pad: AnyPad, controls: dict[str, float], teaching: Teaching) -> list[str]:
    return [*lines(pad.name, controls, pad.events_hz, None), "", *asked(teaching)]


def _readings(seconds: float | None) -> Iterator[float]:
    """[s] The time of each reading."""
    began_s = time.monotonic()
    while seconds is None or time.monotonic() < began_s + seconds:
        yield time.monotonic()
        time.sleep(READ_S)


def _entered() -> bool:
    """Has the user pressed Enter?"""
    if not sys.stdin.isatty() or not select.select([sys.stdin], [], [], 0.0)[0]:
        return False
    return sys.stdin.readline() != ""


@contextmanager
def shown() -> Generator[Show]:
    next_s = 0.0

    def due(now_s: float, pause_s: float) -> bool:
        nonlocal next_s
        if now_s < next_s:
            return False
        next_s = now_s + pause_s
        return True

    if not sys.stdout.isatty():

        def write(now_s: float, look: Callable[[], list[str]]) -> None:
            if due(now_s, LINES_S):
                print(*look(), sep="\n", flush=True)

        yield write
        return
    with Live(auto_refresh=False) as live:

        def draw(now_s: float, look: Callable[[], list[str]]) -> None:
            if due(now_s, SCREEN_S):
                live.update(Text("\n".join(look()), no_wrap=True), refresh=True)

        yield draw
