"""Keeps the services of the drone's side running: `python -m tools.onboard.supervise DESCRIPTOR`.

It prints lines, which systemd keeps. Whatever it hears, it must not end: the vehicle hangs on it.
"""

import os
import traceback
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

from messages import topics
from messages.health import LogLine
from services.runtime.config.errors import LindyError
from services.runtime.launch.local_stack import LocalStack, local_stack
from tools.health_sums import HealthOfAll
from tools.live.dive_timeline import DiveTimeline
from tools.live.keep_running import keep_running
from tools.live.latest import point
from tools.live.printed_lines import PrintedLines
from tools.live.stop_signals import StopSignals
from tools.onboard.plan import DiveEnd, DroneStart, Seen, become, handed_on
from tools.onboard.this_start import mark_ended


def supervise(start: DroneStart) -> NoReturn:
    """… until the dive is over, and then report on it."""
    dive, seen = start.dive, Seen()
    with StopSignals() as stop:
        with _why_it_ended(seen), local_stack(dive) as local, _noted(seen, local):
            if start.claim is not None:
                os.close(start.claim)  # the logs say by themselves whose folder it is
            point(dive.stack.out_dir)
            _OnBoard(local, stop, seen).keep()
        become("report", DiveEnd(dive, seen))


class _OnBoard:
    """A dive between the start of the hub and the end of the services."""

    def __init__(self, local: LocalStack, stop: StopSignals, seen: Seen) -> None:
        self._local, self._stop, self._seen = local, stop, seen
        self._lines = PrintedLines()
        self._timeline = DiveTimeline(None, local.stack.seconds)
        health, node = HealthOfAll(), local.node
        seen.health = health.sums
        node.each(topics.STATUS, self._timeline.see)
        node.each(topics.HEALTH, lambda message, _: health.add(message))
        node.each(topics.LOG, self._show)
        node.show = lambda line: self._show(line, line.stamp_ns)  # nobody hears their own messages

    def keep(self) -> None:
        try:
            self._seen.exit = keep_running(self._local, self._timeline, self._stop, self._look)
            with suppress(OSError):  # it ends anyway
                mark_ended(self._local.plan.checkpoints)
        finally:
            self._seen.armed = self._timeline.armed_ns is not None
            self._lines.finish()

    def _look(self) -> bool:
        self._local.pump()
        return not self._stop.asked

    def _show(self, line: LogLine, now: int) -> None:
        self._lines.line(line, self._timeline.elapsed_s(now))


@contextmanager
def _noted(seen: Seen, local: LocalStack) -> Generator[None]:
    try:
        yield
    finally:
        seen.gone = local.missing()
        seen.restarts, seen.hung = local.restarts, dict(local.hang_detector.times)


@contextmanager
def _why_it_ended(seen: Seen) -> Generator[None]:
    try:
        yield
    except LindyError as error:
        seen.exit = str(error)
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        name = f"{Path(where.filename).name}:{where.lineno}"
        seen.exit = f"an error in Lindy itself, at {name}: {type(error).__name__}: {error}"


if __name__ == "__main__":
    supervise(handed_on(DroneStart))
