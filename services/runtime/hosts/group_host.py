"""The nodes of one process on one thread: one service, or several that share it.

They are stepped one at a time. `Turns` decides which; the process host waits and talks.
"""

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

    @property
    def anybody_woken(self) -> bool:
        return bool(self._woken)

    def woken(self) -> list[int]:
        """Those for which something arrived, in order; what arrives from now on wakes again."""
        nodes = sorted(self._woken.copy())
        self._woken.difference_update(nodes)
        return nodes

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
            cpu_clock: [ns] processor time of the thread that asks.
        """
        self.wake: Callable[[], None] = lambda: None  # the stepper's; a message arrived
        self._nodes = nodes
        self._turns = Turns(len(nodes))
        self._clock = clock
        self._cpu_clock = cpu_clock
        self._cpu_ns = [0] * len(nodes)  # [ns] processor time of each node's steps
        self.running = nodes[0].name  # whose handlers were called last
        for k, node in enumerate(nodes):
            node.wake = self._waker(k)
            node.usage = of_process if len(nodes) == 1 else self._share(k, of_process)
            node.start()

    @property
    def has_arrivals(self) -> bool:
        """Did anything arrive that is not handled yet?"""
        return self._turns.anybody_woken

    def handle_arrivals(self) -> None:
        """Handle messages that arrived, one round, but no timers."""
        for k in self._turns.woken():
            self._run(k, self._nodes[k].handle_arrivals)
            if self._nodes[k].has_arrivals:
                self._turns.wake(k)

    def step(self) -> int:
        """Step the nodes that have something to do, at most one round; returns how many."""
        for count in range(len(self._nodes)):
            if (k := self._turns.next(self._clock())) is None:
                return count
            self._run(k, self._nodes[k].step)
        return len(self._nodes)

    def deadline(self) -> int:
        """[ns] When the next timer of all nodes falls due."""
        return self._turns.until()

    def _run(self, k: int, what: Callable[[], None]) -> None:
        self.running = self._nodes[k].name
        alone = len(self._nodes) == 1
        began = 0 if alone else self._cpu_clock()
        what()
        self._turns.stepped(k, self._nodes[k].deadline())
        if not alone:
            self._cpu_ns[k] += self._cpu_clock() - began

    def _waker(self, k: int) -> Callable[[], None]:
        turns = self._turns

        def wake() -> None:
            turns.wake(k)
            self.wake()

        return wake

    def _share(self, k: int, of_process: Callable[[], Usage]) -> Callable[[], Usage]:
        def usage() -> Usage:
            return Usage(cpu_s=self._cpu_ns[k] / 1e9, rss_mb=of_process().rss_mb)

        return usage
