"""The nodes of one process, stepped one at a time: at their timers on the service's own thread, and
on arrival of a message on the bus's thread, which saves handing it over.

What arrives while one thread steps is left to that thread: it looks again when it is done. So the
bus's thread never waits, and no message is left lying.
"""

import gc
import mmap
import struct
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from services.runtime.config.disk import reason
from services.runtime.node.loop_stats import Usage
from services.runtime.node.node import Node
from services.runtime.os import RARE_SEARCHES

POLL_S = 0.1  # [s] longest wait between two looks at the stop flag
Clock = Callable[[], int]  # [ns]


class Loop:
    """Made when all nodes are wired. Nothing is handled before the first step.

    Nodes are stepped in their order, over and over, each only if something arrived for it or one of
    its timers is due: so a node waits at most until each of the others has been stepped once,
    whoever wakes whom. A service is listed behind those it listens to, and a sample then goes
    through the whole chain in one round.

    Attributes:
        running: name of the node whose handlers were called last.
    """

    def __init__(
        self,
        nodes: list[Node],
        of_process: Callable[[], Usage],
        *,
        on_arrival: bool,
        clock: Clock = time.monotonic_ns,
    ) -> None:
        """
        Args:
            nodes: in the order in which they are stepped.
            of_process: what the process uses. A node that is alone in it reports just that; one
                that shares it reports its part of the processor time.
            on_arrival: False: the bus's thread only wakes the service's own, for services whose
                handlers may take long, such as one that writes a file.
        """
        self.running = nodes[0].name
        self._nodes, self._clock = nodes, clock
        self._cpu_s = [0.0] * len(nodes)  # [s] processor time of each node, up to the last account
        self._accounted_s = of_process().cpu_s  # [s] of the process, up to then
        self._busy_ns = [0] * len(nodes)  # [ns] since then, in the steps of each node …
        self._all_busy_ns = 0  # [ns] … and in all
        self._due = [0] * len(nodes)  # [ns] next timer of each; at first each is stepped once
        self._last = len(nodes) - 1  # the node that was stepped last
        self._arrivals: set[int] = set()  # nodes for which something arrived
        self._on_arrival = on_arrival
        self._lock = threading.Lock()  # held by the thread that steps
        self._lock.acquire()  # until the first step
        self._begun = False
        self._wanted = False  # by the service's thread: its timers must not wait for a flood
        self._woken = threading.Event()
        self._wakes_at = 0  # [ns] when the service's thread wakes by itself
        self._failure: BaseException | None = None  # raised by a handler on the bus's thread
        for k, node in enumerate(nodes):
            node.wake = partial(self._arrived, k)
            node.usage = of_process if len(nodes) == 1 else partial(self._share, k, of_process)
            node.start()

    def step_and_wait(self) -> None:
        """Handle everything that is due; then wait for a timer, or what arrives for this thread, at
        most `POLL_S`. Raises what a handler raised on the bus's thread."""
        self.finish()
        self._wakes_at = min(*self._due, self._clock() + round(POLL_S * 1e9))
        self._lock.release()
        seconds = (self._wakes_at - self._clock()) / 1e9
        if seconds > 0 and not self._arrivals:
            self._woken.wait(seconds)
        self._woken.clear()

    def finish(self) -> None:
        """Handle what has arrived and is due, and nothing from then on: the lock is kept."""
        self._wanted = True
        if self._begun:
            self._lock.acquire()
        self._begun = True
        self._wanted = False  # before the step, which handles what was left to this thread
        if self._failure is not None:
            raise self._failure
        self.step()

    def step(self) -> int:
        """Step the nodes that have something to do, at most one round; returns how many."""
        count = len(self._nodes)
        for stepped in range(count):
            now, last = self._clock(), self._last
            for k in (n % count for n in range(last + 1, last + 1 + count)):
                if k in self._arrivals or self._due[k] <= now:
                    break
            else:
                return stepped
            self._arrivals.discard(k)  # what arrives from now on is another step
            self._last = k
            self._run(k, self._nodes[k].step)
        return count

    def _run(self, k: int, what: Callable[[], object]) -> None:
        node, alone = self._nodes[k], len(self._nodes) == 1
        self.running = node.name
        began = 0 if alone else self._clock()
        if what():  # it has more to do
            self._arrivals.add(k)
        self._due[k] = node.deadline()
        if not alone:
            took = self._clock() - began
            self._busy_ns[k] += took
            self._all_busy_ns += took

    def _arrived(self, k: int) -> None:
        """Something arrived for a node; called on any thread."""
        self._arrivals.add(k)
        if not self._on_arrival:
            self._woken.set()
            return
        while self._arrivals and self._failure is None and not self._wanted:
            if not self._lock.acquire(blocking=False):
                return
            try:
                for each in sorted(self._arrivals.copy()):  # messages, but no timers
                    self._arrivals.discard(each)
                    self._run(each, self._nodes[each].handle_arrivals)
                if min(self._due) < self._wakes_at:
                    self._woken.set()  # a handler has set a timer
            except BaseException as failure:  # Zenoh would log it and go on
                self._failure = failure
                self._woken.set()
            finally:
                self._lock.release()

    def _share(self, k: int, of_process: Callable[[], Usage]) -> Usage:
        """What the process has used since the last account is divided as the time of the steps: to
        ask for the processor time around each of them costs a seventh of the process."""
        used = of_process()
        if self._all_busy_ns:
            rate = (used.cpu_s - self._accounted_s) / self._all_busy_ns
            for n, busy_ns in enumerate(self._busy_ns):
                self._cpu_s[n] += rate * busy_ns
            self._accounted_s, self._all_busy_ns = used.cpu_s, 0
            self._busy_ns = [0] * len(self._nodes)
        return Usage(self._cpu_s[k], used.rss_mb)


@contextmanager
def rare_collections() -> Generator[None]:
    """Enter after everything is set up: existing objects are not searched until the end."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(*RARE_SEARCHES)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()


STAMP = struct.Struct("<q")  # [ns] of the monotonic clock, which all processes of a machine share


class Heartbeat:
    """The writing end. A file that cannot be made is no reason not to run: then nobody watches.

    Attributes:
        unwatched: why, although somebody wanted to watch; empty: all is well.
    """

    def __init__(self, path: Path | None) -> None:
        self._map: mmap.mmap | None = None
        self.unwatched = ""
        if path is None:
            return
        try:
            path.write_bytes(bytes(STAMP.size))
            with path.open("r+b") as file:
                self._map = mmap.mmap(file.fileno(), STAMP.size)
        except OSError as error:
            self.unwatched = f"nobody would notice if it hung: cannot write {path}: {reason(error)}"

    def beat(self, now: int) -> None:
        """The loop goes round at `now` [ns]."""
        if self._map is not None:
            STAMP.pack_into(self._map, 0, now)


def last_beat(path: Path) -> int | None:
    """[ns] When the process of this file last beat; None: never, or nobody can tell."""
    try:
        return STAMP.unpack(path.read_bytes())[0] or None
    except (OSError, struct.error):
        return None
