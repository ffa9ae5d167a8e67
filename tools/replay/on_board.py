"""Feeds services on board what was recorded of their bus, on virtual time.

The recorder heard the drone's bus, so the file has every message these services received, in its
order. A service is stepped where the file shows that it was: before its own next message, and at
the end of each instant.
"""

from collections.abc import Iterator
from typing import NamedTuple

from messages.topic import Side
from services.runtime.bus.memory_bus import MemoryBusPort, matches
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import SAME, VirtualHost
from services.runtime.node.loop_stats import Instance
from services.runtime.node.node import Node
from tools.recordings.recording import Raw
from tools.replay.differences import Told
from tools.replay.feed import Encoder
from tools.replay.outputs import Outputs, told_of
from tools.replay.source import Process, ReplaySource

SIDE: Side = "drone"
RECORDER = "recorder"
# [ns] On a real clock what was recorded so shortly before a service's own message is handled at the
# stamp of that message; what is older, at its own time.
HELD_NS = 5_000_000
NOT_RECORDED = Process(SIDE, 0, 0, 0)


class Waiting(NamedTuple):
    """A recorded message that was not given to the services yet."""

    at_ns: int  # [ns] by the services' clock
    raw: Raw


class OnBoard:
    """One replay. `recorded` and `today` are filled while `run` runs."""

    def __init__(
        self, source: ReplaySource, names: tuple[str, ...], services: Registry, stack: Stack
    ) -> None:
        """
        Args:
            names: of the services, in the order of the stack file.
        """
        self.recorded: list[Told] = []
        self.remarks: list[str] = []
        self.nodes: list[Node] = []
        self._source, self._services, self._stack = source, services, stack
        self._encoder = Encoder(source.recording)
        self._host = VirtualHost({SIDE: SAME} if source.apart else None)
        self._port = MemoryBusPort(self._host.hub(SIDE))
        self.outputs = Outputs(self._port)
        self._starts = _starts(source, names)
        self._wanted: dict[str, bool] = {}  # key: does a service subscribe to it?
        self._own: dict[str, bool] = {}  # key: does a service publish it?
        self._waiting: list[Waiting] = []
        self._settled_ns = -1  # [ns] newest instant at which the services were stepped

    def run(self, until_ns: int) -> None:
        """Replay up to `until_ns` [ns UTC], which is included."""
        self._start(0 if self._source.virtual else self._first_start())
        for raw in self._until(until_ns):
            at = raw.log_ns - self._source.utc_offset_ns
            if self._is_own(raw.key):
                told = told_of(raw, self._source.utc_offset_ns)
                self.recorded.append(told)
                self._reach(told, at if self._source.virtual else told.stamp_ns)
            elif self._is_wanted(raw.key):
                self._hold(Waiting(at, raw))
        self._give(self._waiting)
        self._waiting = []

    def _until(self, until_ns: int) -> Iterator[Raw]:
        return (raw for raw in self._source.raw() if raw.log_ns <= until_ns)

    # When.

    def _hold(self, new: Waiting) -> None:
        """Keep a message until it is known when the services were stepped."""
        if self._source.virtual:
            if self._waiting and self._waiting[-1].at_ns < new.at_ns:
                self._give(self._waiting)
                self._waiting = []
        else:
            late = [one for one in self._waiting if one.at_ns < new.at_ns - HELD_NS]
            self._give(late)
            self._waiting = self._waiting[len(late) :]
        self._waiting.append(new)

    def _reach(self, told: Told, at: int) -> None:
        """A service published this at `at`: it has handled by then what came before."""
        if self._source.virtual:
            if self._waiting or at > self._settled_ns:
                self._step_for(at)
            return
        if at <= self._settled_ns:
            return
        early = [one for one in self._waiting if one.at_ns < at - HELD_NS]
        self._give(early)
        held = self._waiting[len(early) :]
        before = [one for one in held if one.at_ns <= at]
        late = held[len(before) :]
        self._settle(at, before)
        # A message may reach the recorder later than the service that acts on it.
        while late and not self.outputs.has(told):
            self._settle(at, [late.pop(0)])
        self._waiting = late

    def _step_for(self, at: int) -> None:
        waiting, self._waiting = self._waiting, []
        earlier = [one for one in waiting if one.at_ns < at]
        self._give(earlier)
        self._settle(at, waiting[len(earlier) :])

    def _give(self, waiting: list[Waiting]) -> None:
        """Hand over messages, each at its own time."""
        k = 0
        while k < len(waiting):
            at = waiting[k].at_ns
            end = k
            while end < len(waiting) and waiting[end].at_ns <= at:
                end += 1
            self._settle(at, waiting[k:end])
            k = end

    def _settle(self, at: int, messages: list[Waiting]) -> None:
        """Advance to `at`, hand over these messages and step the services."""
        self._start(at)
        host = self._host
        if at > host.now:
            host.run(at - 1)
            host.now = at
        for one in messages:
            if (envelope := self._encoder.envelope(one.raw)) is not None:
                self._port.forward(envelope)
        host.settle()
        self._settled_ns = host.now

    # Who.

    def _first_start(self) -> int:
        return self._starts[0][0]

    def _start(self, now: int) -> None:
        """Start the services whose time has come."""
        while self._starts and self._starts[0][0] <= now:
            at, name, process = self._starts.pop(0)
            if self._host.nodes:
                self._host.run(at)
            self._host.now = max(self._host.now, at)
            if name == RECORDER:  # its health is not in its recording; others hear it
                self._host.node(RECORDER, [SIDE])
                continue
            spec = self._services[name]
            node = self._host.node(name, spec.sides, gateway=spec.gateway)
            node.instance = Instance(process.instance, process.pid)
            self._services.wire(name)(node, self._stack)
            self.nodes.append(node)
            self._wanted, self._own = {}, {}

    def _is_wanted(self, key: str) -> bool:
        if key not in self._wanted:
            heard = [expression for node in self.nodes for _, expression in node.heard]
            self._wanted[key] = any(matches(expression, key) for expression in heard)
        return self._wanted[key]

    def _is_own(self, key: str) -> bool:
        if key not in self._own:
            self._own[key] = any(topic.key == key for n in self.nodes for topic in n.published)
        return self._own[key]


def _starts(source: ReplaySource, names: tuple[str, ...]) -> list[tuple[int, str, Process]]:
    """[ns] When each service started by the clock on board, in that order."""
    if source.virtual:
        order = [*names, RECORDER]
        return [(0, name, source.processes.get(name, NOT_RECORDED)) for name in order]
    known = source.processes
    started = [(known[n].started_ns - source.utc_offset_ns, n, known[n]) for n in names]
    return sorted(started, key=lambda start: start[0])
