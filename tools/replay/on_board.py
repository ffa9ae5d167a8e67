"""Feeds services on board what was recorded of their bus, on virtual time.

The recorder heard the drone's bus, so the file has every message these services received, in its
order. A service is stepped where the file shows that it was: before its own next message, and at
the end of each instant.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec

from messages import topics
from messages.events import Row
from messages.identity import SideIdentity
from messages.message import Message
from messages.payload import UNDECODABLE, PayloadDecoder
from messages.state import VehicleState
from messages.topic import Side
from services.runtime.bus.envelope import Bus, Envelope
from services.runtime.bus.memory_bus import MemoryBusPort, matches
from services.runtime.config.identity import identity_of
from services.runtime.config.stack import Stack
from services.runtime.hosts.loop import rare_collections
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import SAME, VirtualHost
from services.runtime.node.loop_stats import Instance
from services.runtime.node.node import Node
from tools.recordings.recording import Raw
from tools.replay.differences import Told
from tools.replay.source import Process, ReplaySource, open_source

SIDE: Side = "drone"
RECORDER = "recorder"
# [ns] On a real clock what was recorded so shortly before a service's own message is handled at the
# stamp of that message; what is older, at its own time.
HELD_NS = 5_000_000
NAMES_ITS_START = "reference"  # in the epochs it grants
SLOW_START_NS = 5_000_000_000  # [ns] between its wiring and its first tick, at most
OURS = ("version", "commit", "messages", "vehicle_hash")  # what an identity says of the code
NOT_RECORDED = Process(SIDE, 0, 0, 0)


class Head(msgspec.Struct):
    """What every message has."""

    stamp_ns: int
    seq: int = 0
    sensor_ns: int | None = None


HEAD = msgspec.json.Decoder(Head)
Hear = Callable[[str, Message], None]  # by key


class ServiceStart(NamedTuple):
    """When a service was started by the clock on board."""

    at_ns: int  # [ns] when it was wired
    ticks_ns: int  # [ns] from when its rates count
    name: str
    process: Process


class Outputs:
    """What the services of a replay publish on a bus that others use as well, in the form in which
    it is compared."""

    def __init__(self, port: Bus, is_own: Callable[[str], bool], hear: Hear | None) -> None:
        """
        Args:
            is_own: does one of these services publish this key?
            hear: as of `OnBoard`.
        """
        self._is_own, self._hear = is_own, hear
        self._newest: dict[str, int | None] = {}  # by key: [ns] sensor sample of the newest message
        self._by_key: dict[str, list[Told]] = defaultdict(list)
        self._decoders: dict[str, PayloadDecoder[Message]] = {}
        self._encode = msgspec.json.Encoder().encode
        port.hear("**", self._store)

    @property
    def keys(self) -> list[str]:
        return list(self._by_key)

    def of(self, key: str) -> list[Told]:
        """In the order in which they were published."""
        return self._by_key[key]

    def has(self, told: Told) -> bool:
        """Was today's message for this sensor sample published?"""
        return self._newest.get(told.key, -1) == told.sensor_ns

    def _store(self, envelope: Envelope) -> None:
        key = envelope.key
        if not self._is_own(key):
            return
        if (decoder := self._decoders.get(key)) is None:
            topic = topics.find(key)
            assert topic is not None  # nodes publish rows of the topic table only
            decoder = self._decoders[key] = PayloadDecoder(topic)
        message = decoder.read(key, envelope.encoding, envelope.payload)
        if isinstance(message, Row):  # damaged on the link
            return
        sample = self._newest[key] = getattr(message, "sensor_ns", None)
        if self._hear is not None:
            self._hear(key, message)
            return
        data = self._encode(message)
        self._by_key[key].append(Told(key, message.seq, message.stamp_ns, data, sample))


class OnBoard:
    """One replay. `recorded` and `outputs` are filled while `run` runs."""

    def __init__(
        self,
        source: ReplaySource,
        names: tuple[str, ...],
        services: Registry,
        stack: Stack,
        hear: Hear | None = None,
    ) -> None:
        """
        Args:
            names: of the services, in the order of the stack file.
            hear: is given each message that these services publish; then nothing is kept, for of a
                dive of hours it would be too much.
        """
        self._keeps = hear is None
        self.recorded: list[Told] = []
        self.nodes: list[Node] = []
        self._source, self._services, self._stack = source, services, stack
        self._encode = msgspec.msgpack.Encoder().encode
        self._today = identity_of(stack, SIDE, 0)
        self._host = VirtualHost({SIDE: SAME} if source.apart else None)
        self._port = MemoryBusPort(self._host.hub(SIDE))
        self.outputs = Outputs(self._port, self._is_own, hear)
        self._starts = _starts(source, names)
        self._wanted: dict[str, bool] = {}  # key: does a service subscribe to it?
        self._own: set[str] = set()  # keys that a service publishes …
        self._publishers = 0  # … of so many
        self._waiting: list[Raw] = []  # recorded messages that were not given to the services yet
        self._settled_ns = -1  # [ns] newest instant at which the services were stepped

    def run(self, until_ns: int) -> None:
        """Replay up to `until_ns` [ns UTC], which is included."""
        for raw in self._source.raw(until_ns=until_ns):
            at = self._at(raw)
            self._start(at)
            if self._is_own(raw.key):
                if (told := self._told(raw)) is not None:
                    if self._keeps:
                        self.recorded.append(told)
                    self._reach(told, at if self._source.virtual else told.stamp_ns)
            elif self._is_wanted(raw.key):
                self._hold(raw)
        self._give(self._waiting)
        self._waiting = []

    def _told(self, raw: Raw) -> Told | None:
        """A recorded message; its stamp by the clock on board. None: it is none, which is
        counted."""
        try:
            head = HEAD.decode(raw.data)
        except UNDECODABLE:
            self._source.recording.unreadable[raw.key] += 1
            return None
        stamp_ns = raw.publish_ns - self._source.utc_offset_ns
        return Told(raw.key, head.seq, stamp_ns, raw.data, head.sensor_ns)

    def _envelope(self, raw: Raw) -> Envelope | None:
        """JSON as recorded → msgpack as sent. None: this version of Lindy cannot read it, which the
        recording counts.

        A side that had the same Lindy as the drone in the recording has today's in the replay: else
        today's code would take it for another one, and refuse to arm.
        """
        message, topic = self._source.recording.decode(raw), topics.find(raw.key)
        if message is None or topic is None:
            return None
        then = self._source.identity
        if isinstance(message, SideIdentity) and then is not None:
            same = [name for name in OURS if getattr(message, name) == getattr(then, name)]
            today = {name: getattr(self._today, name) for name in same}
            message = msgspec.structs.replace(message, **today)
        return Envelope(raw.key, self._encode(message), topic.encoding)

    def _at(self, raw: Raw) -> int:
        """[ns] When it arrived, by the services' clock."""
        return raw.log_ns - self._source.utc_offset_ns

    def _hold(self, new: Raw) -> None:
        """Keep a message until it is known when the services were stepped."""
        if self._source.virtual:
            if self._waiting and self._waiting[-1].log_ns < new.log_ns:
                self._give(self._waiting)
                self._waiting = []
        else:
            late = [one for one in self._waiting if one.log_ns < new.log_ns - HELD_NS]
            self._give(late)
            self._waiting = self._waiting[len(late) :]
        self._waiting.append(new)

    def _reach(self, told: Told, at: int) -> None:
        """A service published this at `at`: it has handled by then what came before."""
        virtual = self._source.virtual
        if virtual and not self._waiting and at <= self._settled_ns:
            return
        since = at if virtual else at - HELD_NS
        early = [one for one in self._waiting if self._at(one) < since]
        held, self._waiting = self._waiting[len(early) :], []
        self._give(early)
        if virtual:
            self._settle(at, held)
        elif told.sensor_ns is None:
            now = sum(self._at(one) <= at for one in held)
            self._settle(at, held[:now])
            self._waiting = held[now:]
        else:
            # Up to the message that it acted on, which may have reached the recorder later than it.
            while held and not self.outputs.has(told):
                self._settle(at, [held.pop(0)])
            self._waiting = held

    def _give(self, waiting: list[Raw]) -> None:
        """Hand over messages, each at its own time."""
        k = 0
        while k < len(waiting):
            at = self._at(waiting[k])
            end = k
            while end < len(waiting) and self._at(waiting[end]) <= at:
                end += 1
            self._settle(at, waiting[k:end])
            k = end

    def _settle(self, at: int, messages: list[Raw]) -> None:
        """Advance to `at`, hand over these messages and step the services."""
        host = self._host
        if at > host.now:
            host.run(at - 1)
            host.now = at
        for raw in messages:
            if (envelope := self._envelope(raw)) is not None:
                self._port.forward(envelope)
        host.settle()
        self._settled_ns = host.now

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
            self._wanted = {}

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
        count = sum(len(node.published) for node in self.nodes)
        if count != self._publishers:  # some are made with their first message
            self._publishers = count
            self._own = {topic.key for node in self.nodes for topic in node.published}
        return key in self._own


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


def states_of_today(recording: Path) -> Iterator[VehicleState]:
    """In the order of their samples, stamps by the services' clock.

    Raises:
        LindyError: it is no recording, or its vehicle is not in it.
    """
    source, states = open_source(recording), list[VehicleState]()

    def hear(_: str, message: Message) -> None:
        if isinstance(message, VehicleState):
            states.append(message)

    with source.stack() as stack, rare_collections():
        replay = OnBoard(source, ("estimation",), Registry.read("simulated"), stack, hear)
        replay.run(source.span[1])
    return iter(states)
