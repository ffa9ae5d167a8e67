"""How far a long reading of a recording has come: a bar on the terminal, nothing elsewhere."""

import sys
from collections.abc import Generator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from tools.recordings.mcap_records import At, nowhere

STEP = 1_000_000  # [bytes] between two looks at the bar


@contextmanager
def reading(what: str, size: int) -> Generator[At]:
    """
    Args:
        size: [bytes] of everything that will be read.
    """
    if not sys.stderr.isatty():
        yield nowhere
        return
    columns = TextColumn(what), BarColumn(), TextColumn("{task.percentage:3.0f} %")
    console = Console(stderr=True)
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as bar:
        task = bar.add_task(what, total=size)
        shown = 0

        def at(read: int) -> None:
            nonlocal shown
            if read >= shown + STEP:
                shown = read
                bar.update(task, completed=read)

        yield at
