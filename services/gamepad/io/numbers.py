"""Shows the head-up numbers of a running dive in a pilot's window, beside the sticks."""

import time
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

from messages import topics
from services.piloting.head_up import NumbersRow, head_up
from services.piloting.pilot_view import PilotView, pilot_view
from services.runtime.node.node import Node

LOOK_HZ = 25.0  # [1/s] often enough that no port overflows at 100 Hz
PAUSE_NS = 100_000_000  # [ns] between two pictures
SHARE = 10  # the sticks have the rest: a picture's time is at most a tenth of all


@runtime_checkable
class HasWindow(Protocol):
    """A source of sticks with a window of its own."""

    def show(self, rows: Sequence[NumbersRow]) -> None: ...


class Numbers:
    """Subscribes to what a pilot must see, and has it drawn ten times a second.

    Make it after what publishes the sticks: of two timers that are due, the older one is served
    first, so that a picture is drawn in the pause after the sticks were sent.
    """

    def __init__(self, node: Node, draw: Callable[[Sequence[NumbersRow]], None]) -> None:
        self._draw = draw
        self._next_ns = 0
        self._status = node.latest(topics.STATUS)
        self._state = node.latest(topics.STATE)
        self._reference = node.latest(topics.REFERENCE)
        self._battery = node.latest(topics.BATTERY)
        self._link = node.latest(topics.LINK)
        self._clock = node.latest(topics.CLOCK)
        self._budget = node.latest(topics.LATENCY)
        node.every(LOOK_HZ, self._look)

    def view(self, now: int) -> PilotView:
        return pilot_view(
            now,
            status=self._status.newest(now),
            state=self._state.newest(now),
            reference=self._reference.newest(now),
            battery=self._battery.fresh(now),
            link=self._link.fresh(now),
            clock=self._clock.fresh(now),
            budget=self._budget.fresh(now),
            note="no status from the drone yet",
        )

    def _look(self, now: int) -> None:
        view = self.view(now)
        if now < self._next_ns:
            return
        began = time.perf_counter_ns()
        self._draw(head_up(view))
        self._next_ns = now + pause_ns(time.perf_counter_ns() - began)


def pause_ns(cost_ns: int) -> int:
    """[ns] Until the next picture, after one that took `cost_ns`."""
    return max(PAUSE_NS, SHARE * cost_ns)
