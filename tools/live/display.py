"""Shows a running dive: a screen on a terminal, otherwise a line every few seconds."""

import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from typing import Protocol

from rich.console import Console, ConsoleDimensions, RenderableType
from rich.live import Live

from messages.health import LogLine
from services.vehicle_view.log_lines import LogEntry, LogLines, full
from tools.live.screen import COLUMNS, View, plain, render

SCREEN_S = 0.25  # [s] between two screens
LINE_S = 5.0  # [s] between two lines
Make = Callable[[ConsoleDimensions], RenderableType]  # for a terminal of this size


class Display(Protocol):
    def show(self, look: Callable[[], View]) -> None:
        """Show the view that `look` makes, if the next one is due."""
        ...

    def line(self, line: LogLine, at_s: float | None) -> None:
        """A log line has arrived, `at_s` [s] after arming; the screen gets it with its view."""
        ...


class ScreenDisplay:
    def __init__(self, draw: Callable[[Make], None]) -> None:
        self._draw = draw
        self._next_s = 0.0

    def show(self, look: Callable[[], View]) -> None:
        if (now := time.monotonic()) >= self._next_s:
            self._next_s = now + SCREEN_S
            self._draw(lambda size: render(look(), size.height - 1, max(COLUMNS, size.width)))

    def line(self, line: LogLine, at_s: float | None) -> None:
        pass


class PrintedLines:
    """Log lines on stdout. One that is repeated is printed the first, tenth, hundredth … time, and
    a warning or an error also when it comes back after a while."""

    def __init__(self) -> None:
        self._lines = LogLines()

    def line(self, line: LogLine, at_s: float | None) -> None:
        """A log line has arrived, `at_s` [s] after arming."""
        if (entry := self._lines.add(line, at_s)) is not None:
            _print(entry)

    def finish(self) -> None:
        """Print the lines that were repeated since they were printed last."""
        for entry in self._lines.unprinted():
            _print(entry)


def _print(entry: LogEntry) -> None:
    with suppress(OSError):  # whoever read it may be gone, and the dive goes on
        print(full(entry), flush=True)


class LineDisplay(PrintedLines):
    def __init__(self) -> None:
        super().__init__()
        self._next_s = 0.0

    def show(self, look: Callable[[], View]) -> None:
        if (now := time.monotonic()) >= self._next_s:
            self._next_s = now + LINE_S
            line = plain(look())
            with suppress(OSError):  # whoever read it may be gone, and the dive goes on
                print(line, flush=True)


@contextmanager
def display() -> Generator[Display]:
    """A screen if stdout is a terminal, otherwise lines."""
    if not sys.stdout.isatty():
        shown = LineDisplay()
        try:
            yield shown
        finally:
            shown.finish()
        return
    with drawn_anew() as draw:
        yield ScreenDisplay(draw)


@contextmanager
def drawn_anew(console: Console | None = None) -> Generator[Callable[[Make], None]]:
    """Yields a function that draws; what it drew before goes. The cursor stands in the row below:
    a terminal scrolls when its last row is full.

    Args:
        console: default: the standard output.
    """
    # No refresh thread: the screen must not compete with the bus for the processor.
    with Live(console=console or Console(), auto_refresh=False, transient=True) as live:
        before = live.console.size

        def draw(make: Make) -> None:
            nonlocal before
            size = live.console.size
            if size != before:  # the terminal has wrapped the rows anew, nobody knows where
                live.stop()
                live.console.clear()
                live.start()
                before = size
            live.update(make(size), refresh=True)

        yield draw
