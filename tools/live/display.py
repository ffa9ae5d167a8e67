"""Shows a running dive: a screen on a terminal, otherwise a line every few seconds."""

import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from typing import Protocol

from messages.health import LogLine
from tools.live.printed_lines import PrintedLines
from tools.live.screen import COLUMNS, View, plain, render
from tools.live.terminal import Make, drawn_anew

SCREEN_S = 0.25  # [s] between two screens
LINE_S = 5.0  # [s] between two lines


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
