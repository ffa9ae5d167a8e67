"""The bus in memory matches keys as Zenoh does, and its messages cross it byte for byte."""

import zenoh
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.topic import AnyTopic
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort, matches

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


@given(
    st.lists(st.tuples(st.integers(0, 2), PATTERNS), max_size=6),
    st.lists(st.tuples(st.integers(0, 2), KEYS, st.binary(max_size=8)), max_size=12),
)
def test_everybody_hears_what_the_others_say_in_order_and_nobody_themselves(
    ears: list[tuple[int, str]], said: list[tuple[int, str, bytes]]
) -> None:
    bus = MemoryBus()
    ports = [MemoryBusPort(bus) for _ in range(3)]
    heard: list[list[Envelope]] = [[] for _ in ears]
    for (who, pattern), into in zip(ears, heard, strict=True):
        ports[who].hear(pattern, into.append)
    for who, key, payload in said:
        ports[who].forward(Envelope(key, payload, "text/plain", b"with"))
    for (who, pattern), into in zip(ears, heard, strict=True):
        expected = [(k, p) for speaker, k, p in said if speaker != who and matches(pattern, k)]
        assert [(e.key, e.payload) for e in into] == expected
        assert all((e.encoding, e.attachment) == ("text/plain", b"with") for e in into)


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
