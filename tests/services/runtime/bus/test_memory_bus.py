"""The bus in memory, and nodes that share a connection: keys match as in Zenoh, and everybody else
receives each message once."""

from collections.abc import Callable

import zenoh
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.topic import AnyTopic
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort, matches
from services.runtime.bus.shared_bus import SharedBus, SharedBusPort

CHUNK = st.sampled_from(["a", "b", "state", "health", "log", "control", "pilot", "command", "1_x"])
KEYS = st.one_of(
    st.lists(CHUNK, min_size=1, max_size=4).map("/".join),
    st.sampled_from([topic.key.replace("*", "control") for topic in topics.ALL]),
)
# The patterns that Lindy listens on: a row of the table, a family, everything.
PATTERNS = st.one_of(
    KEYS,
    KEYS.map(lambda key: f"{key}/*"),
    st.sampled_from([topic.key for topic in topics.ALL]),
    st.just("**"),
)


@given(PATTERNS, KEYS)
def test_keys_match_as_in_zenoh(pattern: str, key: str) -> None:
    theirs, said = zenoh.KeyExpr(pattern), zenoh.KeyExpr(key)
    assert matches(pattern, key) == theirs.includes(said) == theirs.intersects(said)


@given(st.sampled_from(topics.ALL), KEYS)
def test_the_table_finds_a_key_where_the_bus_delivers_it(topic: AnyTopic, key: str) -> None:
    assert topic.covers(key) == matches(topic.key, key)


def test_who_comes_later_is_heard_and_who_has_left_hears_nothing() -> None:
    bus, heard = MemoryBus(), list[Envelope]()
    talker, early, late = (MemoryBusPort(bus) for _ in range(3))
    early.hear("state", heard.append)
    say = talker.say(topics.STATE)
    say(b"1")
    late.hear("**", heard.append)  # the route of this key was found without it
    say(b"2")
    early.close()
    say(b"3")
    assert [e.payload for e in heard] == [b"1", b"2", b"2", b"3"]
    assert {(e.key, e.encoding) for e in heard} == {("state", topics.STATE.encoding)}


# Nodes that share a connection.


PROCESSES, NODES = 3, 3  # nodes in each process
SPEAKERS = st.tuples(st.integers(0, PROCESSES - 1), st.integers(0, NODES - 1))
FEW_KEYS = st.sampled_from(["state", "reference", "health/control", "log/control"])
FEW_PATTERNS = st.one_of(FEW_KEYS, st.sampled_from(["**", "health/*"]))


class Counted:
    """A connection that notes what goes through it."""

    def __init__(self, bus: MemoryBus) -> None:
        self._port = MemoryBusPort(bus)
        self.heard: list[str] = []  # key expressions
        self.hear = self._hear
        self.say = self._port.say
        self.said: list[Envelope] = []

    def _hear(self, key_expression: str, store: Callable[[Envelope], None]) -> None:
        self.heard.append(key_expression)
        self._port.hear(key_expression, store)

    def forward(self, envelope: Envelope) -> None:
        self.said.append(envelope)
        self._port.forward(envelope)


@given(
    st.lists(st.tuples(SPEAKERS, FEW_PATTERNS), max_size=12),
    st.lists(st.tuples(SPEAKERS, FEW_KEYS), max_size=12),
)
def test_everybody_else_hears_each_message_once_and_in_order(
    ears: list[tuple[tuple[int, int], str]], said: list[tuple[tuple[int, int], str]]
) -> None:
    network = MemoryBus()
    connections = [Counted(network) for _ in range(PROCESSES)]
    buses = [SharedBus(connection) for connection in connections]
    nodes = [[SharedBusPort(bus) for _ in range(NODES)] for bus in buses]
    heard: list[list[Envelope]] = [[] for _ in ears]
    for ((process, node), pattern), into in zip(ears, heard, strict=True):
        nodes[process][node].hear(pattern, lambda e, into=into: into.append(e))
    for number, ((process, node), key) in enumerate(said):
        nodes[process][node].forward(Envelope(key, bytes([number]), "text/plain", b"with"))
    for (who, pattern), into in zip(ears, heard, strict=True):
        assert [(e.payload, e.encoding, e.attachment) for e in into] == [
            (bytes([number]), "text/plain", b"with")
            for number, (speaker, key) in enumerate(said)
            if speaker != who and matches(pattern, key)
        ]
    for process, connection in enumerate(connections):
        assert len(connection.said) == sum(speaker[0] == process for speaker, _ in said)
        assert sorted(connection.heard) == sorted({p for (on, _), p in ears if on == process})


def test_what_a_node_says_is_inside_what_it_is_outside() -> None:
    network, inside, outside = MemoryBus(), list[Envelope](), list[Envelope]()
    bus = SharedBus(MemoryBusPort(network))
    talker, ear = SharedBusPort(bus), SharedBusPort(bus)
    ear.hear("**", inside.append)
    MemoryBusPort(network).hear("**", outside.append)
    for topic in topics.ALL:
        talker.say(topic)(topic.key.encode())
    assert [(e.key, e.payload, e.encoding) for e in inside] == [
        (e.key, e.payload, e.encoding) for e in outside
    ]
