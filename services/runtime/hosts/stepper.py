"""Steps a node: at its timers on the service's own thread, and on arrival of a message on the bus's
thread, which saves handing it over. One thread at a time, under a lock.

What arrives while the lock is taken is left to the thread that holds it: it looks again after it
has let go. So the bus's thread never waits, and no message is left lying.
"""

import threading
import time
from collections.abc import Callable
from typing import Protocol

POLL_S = 0.1  # longest wait between two looks at the stop flag


class Steppable(Protocol):
    """A node, or a group of them."""

    wake: Callable[[], None]  # the stepper's; called when something arrived

    @property
    def has_arrivals(self) -> bool: ...
    def handle_arrivals(self) -> None: ...
    def step(self) -> object: ...
    def deadline(self) -> int: ...


class Stepper:
    """Takes over `node.wake`. Nothing is handled before the first `step_and_wait`."""

    def __init__(self, node: Steppable, *, on_arrival: bool) -> None:
        """
        Args:
            on_arrival: False: the bus's thread only wakes the service's own, for a service whose
                handlers may take long, such as one that writes a file.
        """
        self._node = node
        self._lock = threading.Lock()  # held by the thread that steps the node
        self._lock.acquire()  # until the first step
        self._begun = False
        self._wanted = False  # by the service's thread: its timers must not wait for a flood
        self._woken = threading.Event()
        self._wakes_at = 0  # [ns] when the service's thread wakes by itself
        self._failure: BaseException | None = None  # raised by a handler on the bus's thread
        node.wake = self._step_on_arrival if on_arrival else self._woken.set

    def step_and_wait(self) -> None:
        """Handle everything that is due; then wait for a timer, or what `wake` leaves to this
        thread, at most `POLL_S`. Raises what a handler raised on the bus's thread."""
        self._step()
        self._wakes_at = min(self._node.deadline(), time.monotonic_ns() + round(POLL_S * 1e9))
        self._lock.release()
        seconds = (self._wakes_at - time.monotonic_ns()) / 1e9
        if seconds > 0 and not self._node.has_arrivals:
            self._woken.wait(seconds)
        self._woken.clear()

    def finish(self) -> None:
        """Handle what has arrived, and nothing from then on."""
        self._step()  # the lock is kept

    def _step(self) -> None:
        """Take the lock, keep it, and handle everything that is due."""
        self._wanted = True
        if self._begun:
            self._lock.acquire()
        self._begun = True
        self._wanted = False  # before the step, which handles what was left to this thread
        if self._failure is not None:
            raise self._failure
        self._node.step()

    def _step_on_arrival(self) -> None:
        node = self._node
        while node.has_arrivals and self._failure is None and not self._wanted:
            if not self._lock.acquire(blocking=False):
                return
            try:
                node.handle_arrivals()
                if node.deadline() < self._wakes_at:
                    self._woken.set()  # a handler has set a timer
            except BaseException as failure:  # Zenoh would log it and go on
                self._failure = failure
                self._woken.set()
            finally:
                self._lock.release()
