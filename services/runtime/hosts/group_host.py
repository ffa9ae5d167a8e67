"""The nodes of one process on one thread: one service, or several that share it.

They are stepped one at a time. `Turns` decides which; the process host waits and talks.
"""

import threading
import time
from collections.abc import Callable

from services.runtime.node.loop_stats import Usage
from services.runtime.node.node import Node

Clock = Callable[[], int]  # [ns]


class Turns:
    """Whose turn it is. Pure, except that `wake` may be called from any thread.

    Nodes are numbers from 0. They are stepped in the order of their numbers, over and over, each
    only if something arrived for it or one of its timers is due: so a node waits at most until
    each of the others has been stepped once, whoever wakes whom. A service is listed behind those
    it listens to, and a sample then goes through the whole chain in one round.
    """

    def __init__(self, nodes: int) -> None:
        self._due = [0] * nodes  # [ns] next timer of each; at first each is stepped once
        self._woken: set[int] = set()
        self._after = [[(k + 1 + n) % nodes for n in range(nodes)] for k in range(nodes)]
        self._last = nodes - 1  # the node that was stepped last

    def wake(self, node: int) -> None:
        """Something arrived for this node."""
        self._woken.add(node)

    def next(self, now: int) -> int | None:
        """The node to step at `now` [ns]; None: nobody has anything to do."""
        for node in self._after[self._last]:
            if node in self._woken or self._due[node] <= now:
                self._woken.discard(node)  # what arrives from now on wakes it again
                self._last = node
                return node
        return None

    def stepped(self, node: int, deadline: int) -> None:
        """The node was stepped; its next timer falls due at `deadline` [ns]."""
        self._due[node] = deadline

    def until(self) -> int:
        """[ns] When the next timer of all nodes falls due."""
        return min(self._due)


class GroupHost:
    """Steps the nodes of a process. Made when all of them are wired."""

    def __init__(
        self,
        nodes: list[Node],
        of_process: Callable[[], Usage],
        clock: Clock = time.monotonic_ns,
        cpu_clock: Clock = time.thread_time_ns,
    ) -> None:
        """
        Args:
            nodes: in the order in which they are stepped.
            of_process: what the process uses. A node that is alone in it reports just that; one
                that shares it reports the processor time of its own steps instead.
            cpu_clock: [ns] processor time of this thread.
        """
        self._arrived = threading.Event()  # a message, from outside of this thread
        self._nodes = nodes
        self._turns = Turns(len(nodes))
        self._clock = clock
        self._cpu_clock = cpu_clock
        self._cpu_ns = [0] * len(nodes)  # [ns] processor time of each node's steps …
        self._cpu_until = cpu_clock()  # [ns] … up to this one
        self._thread = threading.get_ident()
        for k, node in enumerate(nodes):
            node.wake = self._waker(k)
            node.usage = of_process if len(nodes) == 1 else self._share(k, of_process)
            node.start()

    def step(self) -> bool:
        """Step the node whose turn it is. False: nobody has anything to do."""
        if (k := self._turns.next(self._clock())) is None:
            return False
        self._step(k)
        return True

    def step_all(self) -> None:
        """Step every node once, as before the end."""
        for k in range(len(self._nodes)):
            self._step(k)

    def wait(self, longest_s: float) -> None:
        """After `step` has found nothing to do: wait until a message arrives or a timer is due, at
        most `longest_s` [s]."""
        seconds = min(longest_s, (self._turns.until() - self._clock()) / 1e9)
        if seconds > 0:
            self._arrived.wait(seconds)
        self._arrived.clear()

    def _step(self, k: int) -> None:
        node = self._nodes[k]
        node.step()
        self._turns.stepped(k, node.deadline())
        if len(self._nodes) > 1:
            cpu = self._cpu_clock()  # includes waking up for it
            self._cpu_ns[k] += cpu - self._cpu_until
            self._cpu_until = cpu

    def _waker(self, k: int) -> Callable[[], None]:
        turns, arrived, own = self._turns, self._arrived, self._thread

        def wake() -> None:
            turns.wake(k)
            if threading.get_ident() != own:  # this thread looks whose turn it is before it waits
                arrived.set()

        return wake

    def _share(self, k: int, of_process: Callable[[], Usage]) -> Callable[[], Usage]:
        def usage() -> Usage:
            return Usage(cpu_s=self._cpu_ns[k] / 1e9, rss_mb=of_process().rss_mb)

        return usage
