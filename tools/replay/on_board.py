"""Feeds services on board what was recorded of their bus, on virtual time.

The recorder heard the drone's bus, so the file has every message these services received, in its
order. A service is stepped where the file shows that it was: before its own next message, and at
the end of each instant.
"""

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
NAMES_ITS_START = "reference"  # in the epochs it grants
SLOW_START_NS = 5_000_000_000  # [ns] between its wiring and its first tick, at most
SAID_AGAIN = ("health/", "identity/")
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
        self.nodes: list[Node] = []
        self._source, self._services, self._stack = source, services, stack
        self._encoder = Encoder(source, stack)
        self._host = VirtualHost({SIDE: SAME} if source.apart else None)
        self._port = MemoryBusPort(self._host.hub(SIDE))
        self.outputs = Outputs([self._port], self._is_own)
        self._starts = _starts(source, names)
        self._wanted: dict[str, bool] = {}  # key: does a service subscribe to it?
        self._own: dict[str, bool] = {}  # key: does a service publish it?
        self._first: dict[str, int] = {}  # key: number of the first message in the recording
        self._waiting: list[Waiting] = []
        self._settled_ns = -1  # [ns] newest instant at which the services were stepped

    def run(self, until_ns: int) -> None:
        """Replay up to `until_ns` [ns UTC], which is included."""
        for raw in self._source.raw(until_ns=until_ns):
            at = raw.log_ns - self._source.utc_offset_ns
            self._first.setdefault(raw.key, raw.sequence)
            self._start(at)
            if self._is_own(raw.key):
                source = self._source
                told = told_of(raw, source.utc_offset_ns, source.recording.unreadable)
                if told is not None:
                    self.recorded.append(told)
                    self._reach(told, at if source.virtual else told.stamp_ns)
            elif self._is_wanted(raw.key):
                self._hold(Waiting(at, raw))
        self._give(self._waiting)
        self._waiting = []

    @property
    def begins_after(self) -> dict[str, int]:
        """How many messages of its inputs were published before the first that is recorded, by
        key; only of those that are not recorded from their first message on. Of health and
        identity, which are said again every second, hardly any recording has the first."""
        return {
            key: before
            for key, before in sorted(self._first.items())
            if before > 0
            and not key.startswith(SAID_AGAIN)
            and self._is_wanted(key)
            and not self._is_own(key)
        }

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
        early = [one for one in self._waiting if one.at_ns < at - HELD_NS]
        self._give(early)
        held = self._waiting[len(early) :]
        if told.sensor_ns is None:
            now = sum(one.at_ns <= at for one in held)
            self._settle(at, held[:now])
            self._waiting = held[now:]
            return
        # Up to the message that it acted on, which may have reached the recorder later than it.
        while held and not self.outputs.has(told):
            self._settle(at, [held.pop(0)])
        self._waiting = held

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

    def _start(self, now: int) -> None:
        """Start the services whose time has come, and hand over nothing from before."""
        while self._starts and self._starts[0].at_ns <= now:
            start = self._starts.pop(0)
            self._advance(start.at_ns)
            if start.name == RECORDER:  # its health is not in its recording; others hear it
                self._host.node(RECORDER, [SIDE])
                continue
            spec = self._services[start.name]
            node = self._host.node(start.name, spec.sides, gateway=spec.gateway)
            node.instance = Instance(start.process.instance, start.process.pid)
            self.nodes.append(node)  # what it publishes while it is wired is its own, too
            self._services.wire(start.name)(node, self._stack)
            self._advance(start.ticks_ns)
            node.start()
            self._wanted, self._own = {}, {}

    def _advance(self, to: int) -> None:
        if self._host.nodes and to > self._host.now:
            self._host.run(to)
        self._host.now = max(self._host.now, to)

    def _is_wanted(self, key: str) -> bool:
        if key not in self._wanted:
            heard = [expression for node in self.nodes for _, expression in node.heard]
            self._wanted[key] = any(matches(expression, key) for expression in heard)
        return self._wanted[key]

    def _is_own(self, key: str) -> bool:
        if not self._own.get(key):  # a publisher may be new
            self._own[key] = any(topic.key == key for n in self.nodes for topic in n.published)
        return self._own[key]


class ServiceStart(NamedTuple):
    """When a service was started by the clock on board."""

    at_ns: int  # [ns] when it was wired
    ticks_ns: int  # [ns] from when its rates count
    name: str
    process: Process


def _starts(source: ReplaySource, names: tuple[str, ...]) -> list[ServiceStart]:
    """In the order of their starts."""
    if source.virtual:
        return [
            ServiceStart(0, 0, n, source.processes.get(n, NOT_RECORDED)) for n in (*names, RECORDER)
        ]
    found: list[ServiceStart] = []
    for name in names:
        process = source.processes.get(name, Process(SIDE, source.origin_ns, 0, 0))  # imported
        ticks = process.started_ns - source.utc_offset_ns
        named = source.named_start_ns if name == NAMES_ITS_START else None
        at = ticks if named is None or not 0 <= ticks - named < SLOW_START_NS else named
        found.append(ServiceStart(at, ticks, name, process))
    return sorted(found)
