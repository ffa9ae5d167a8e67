"""A part of the terminal that is drawn anew, until the program ends."""

from collections.abc import Callable, Generator
from contextlib import contextmanager

from rich.console import Console, ConsoleDimensions, RenderableType
from rich.live import Live

Make = Callable[[ConsoleDimensions], RenderableType]  # for a terminal of this size


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
