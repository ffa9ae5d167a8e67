"""Shows a dive while it goes on: one screen on a terminal, a line now and then elsewhere."""

import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.live import Live

from messages.health import LogLine
from tools.screen import View, line_of, plain, render

SCREEN_S = 0.25  # [s] between two screens
LINE_S = 5.0  # [s] between two lines


class Display(Protocol):
    def show(self, look: Callable[[], View]) -> None:
        """Show the view that `look` makes, if it is time for one."""
        ...

    def line(self, line: LogLine) -> None:
        """A log line has come; the screen gets it with the next view."""
        ...


class ScreenDisplay:
    def __init__(self, live: Live) -> None:
        self._live = live
        self._next_s = 0.0

    def show(self, look: Callable[[], View]) -> None:
        if (now := time.monotonic()) >= self._next_s:
            self._next_s = now + SCREEN_S
            self._live.update(render(look()), refresh=True)

    def line(self, line: LogLine) -> None:
        pass


class LineDisplay:
    def __init__(self) -> None:
        self._next_s = 0.0

    def show(self, look: Callable[[], View]) -> None:
        if (now := time.monotonic()) >= self._next_s:
            self._next_s = now + LINE_S
            print(plain(look()), flush=True)

    def line(self, line: LogLine) -> None:
        print(line_of(line), flush=True)


@contextmanager
def display() -> Generator[Display]:
    """The display that suits where the output goes."""
    if not sys.stdout.isatty():
        yield LineDisplay()
        return
    # Refreshed by us, not by a thread: the screen must not compete with the bus.
    with Live(console=Console(), auto_refresh=False, transient=True) as live:
        yield ScreenDisplay(live)
