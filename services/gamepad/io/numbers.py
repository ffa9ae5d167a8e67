"""Shows the head-up numbers of a running dive in a pilot's window, beside the sticks."""

import time
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

from services.runtime.node.node import Node
from services.vehicle_view.head_up import NumbersRow, head_up
from services.vehicle_view.io.ports import LOOK_HZ, VehiclePorts
from services.vehicle_view.view import vehicle_view

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
        self._ports = VehiclePorts(node)
        node.every(LOOK_HZ, self._look)

    def _look(self, now: int) -> None:
        newest = self._ports.newest(now)
        if now < self._next_ns:
            return
        began = time.perf_counter_ns()
        self._draw(head_up(vehicle_view(newest, now)))
        self._next_ns = now + pause_ns(time.perf_counter_ns() - began)


def pause_ns(cost_ns: int) -> int:
    """[ns] Until the next picture, after one that took `cost_ns`."""
    return max(PAUSE_NS, SHARE * cost_ns)
