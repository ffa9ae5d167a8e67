"""No message ends a service: neither bytes without meaning nor messages that are whole, within
their limits and absurd."""

import math
from collections import Counter

import msgspec
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from messages import topics
from messages.events import Event, Outbox
from messages.health import LogLine
from messages.message import Message
from messages.payload import LONGEST, PayloadDecoder
from messages.topic import AnyTopic
from services.recorder.core import Intake
from services.runtime.bus.envelope import Envelope
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.gate import Gate
from services.runtime.node.loop_stats import LoopStats
from services.runtime.node.ports import Inbox
from tests.support.dive import Dive
from tests.support.messages import any_of
from tools.live.dive_timeline import DiveTimeline
from tools.live.watch import Watch

SECOND = 1_000_000_000
every_topic = st.sampled_from(topics.ALL)


@st.composite
def said(draw: st.DrawFn) -> tuple[AnyTopic, Message]:
    topic = draw(every_topic)
    if topic.is_family:
        topic = topic.of(draw(st.sampled_from(["control", "supervisor", "z"])))
    return topic, draw(any_of(topic.message))


def test_every_field_of_every_message_has_limits() -> None:
    for topic in topics.ALL:
        any_of(topic.message)


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A message with some of its bytes replaced, taken out or doubled."""
    _, message = draw(said())
    payload = bytearray(msgspec.msgpack.encode(message))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(0, len(payload) - 1)))
        payload[at : at + draw(st.integers(0, 2))] = draw(st.binary(max_size=3))
    return bytes(payload)


@given(payload=st.binary(max_size=200) | damaged(), topic=every_topic)
@settings(max_examples=600)
@example(payload=b"\x81\xa6source\xa1\xff", topic=topics.PILOT_COMMAND)  # text not in UTF-8
@example(payload=b"\x81\xa3seq\xcf" + b"\xff" * 8, topic=topics.CLOCK)  # beyond 63 bit
@example(payload=b"\x91" * 100_000, topic=topics.PILOT_REQUEST)  # deeper than any stack
def test_no_bytes_are_more_than_a_refused_message(payload: bytes, topic: AnyTopic) -> None:
    counts: Counter[str] = Counter()
    Gate(topic, Outbox(counts)).admit(Envelope(topic.key, payload, topic.encoding), SECOND)
    lost = Outbox()
    Intake(lost).check(topic.key, topic.encoding, payload, SECOND)
    assert {*counts.values(), *lost.counts.values()} <= {1}


def test_what_is_too_long_is_not_kept() -> None:
    counts: Counter[str] = Counter()
    inbox = Inbox("clock", 8, lambda: 0, Outbox(counts))
    for size in (LONGEST, LONGEST + 1):
        inbox.store(Envelope("clock", bytes(size), "any"))
    assert [len(envelope.payload) for _, envelope in inbox.take_all()] == [LONGEST]
    assert counts == {"oversized:clock": 1}


@given(numbers=st.lists(st.sampled_from([0, 1, 2**53]) | st.integers(0, 2**53)))
def test_no_sequence_of_numbers_makes_a_count_that_cannot_be_sent(numbers: list[int]) -> None:
    counts: Counter[str] = Counter()
    gate = Gate(topics.LOG.of("z"), Outbox(counts))
    for at, number in enumerate([0, 2**53, *numbers]):
        line = LogLine(stamp_ns=at, seq=number, service="z", level="info", text="")
        gate.admit(Envelope("log/z", msgspec.msgpack.encode(line), topics.LOG.encoding), at)
    health = LoopStats().report("z", SECOND, 0, 0, counts, None)
    payload = msgspec.msgpack.encode(health)
    assert PayloadDecoder(topics.HEALTH).read("health/z", topics.HEALTH.encoding, payload) == health


@given(
    names=st.lists(st.text(max_size=300), max_size=30),
    many=st.integers(0, 3000),
    text=st.text(max_size=5000),
)
@settings(max_examples=30)
def test_whatever_a_service_counts_or_logs_is_within_the_limits(
    names: list[str], many: int, text: str
) -> None:
    host = VirtualHost()
    talker, listener = host.node("talker", ["drone"]), host.node("listener", ["drone"])
    heard: list[Message] = []
    listener.each(topics.HEALTH.of("talker"), lambda health, _: heard.append(health))
    listener.each(topics.LOG, lambda line, _: heard.append(line))
    for name in (*names, *map(str, range(many))):
        talker.tell(Event(name))
    talker.log("info", text)
    host.run(round(1.5 * SECOND))
    assert len(heard) == 2


class StrangersDive(Dive):
    """A dive that is never restarted, with a stranger on both sides of the tether."""

    def __init__(self) -> None:
        every = Registry.read()
        script = "0,0.3,0,0.2,0\n3,0,0,0,0\n600,0,0,0,0\n"
        super().__init__(script, [n for n in every if n not in ("recorder", "visualizer")])
        self.strangers = [self.host.side("topside"), self.host.side("drone")]
        self.screen = self.host.node("screen", ["topside"])
        self.watch = Watch(self.screen, list(every), DiveTimeline(None), lambda _line, _at: None)
        self.actuated = self.heard(topics.ACTUATION)
        self.until_armed()

    def say(self, topic: AnyTopic, message: Message) -> None:
        """A message of now, or it would not even be looked at."""
        fresh = msgspec.structs.replace(message, stamp_ns=self.host.now)
        payload = msgspec.msgpack.encode(fresh)
        for stranger in self.strangers:
            stranger.forward(Envelope(topic.key, payload, topic.encoding, None, None))

    def go_on(self) -> None:
        self.actuated.clear()
        self.host.run(self.host.now + SECOND // 4)
        self.watch.view("", self.host.now, [], {})


@pytest.fixture(scope="module")
def flown() -> StrangersDive:
    return StrangersDive()


@given(messages=st.lists(said(), min_size=20, max_size=40))
@settings(max_examples=40)
def test_no_message_ends_a_service_or_reaches_a_thruster_as_no_number(
    flown: StrangersDive, messages: list[tuple[AnyTopic, Message]]
) -> None:
    for topic, message in messages:
        flown.say(topic, message)
    flown.go_on()  # raises what a handler raises
    assert all(math.isfinite(force) for sent in flown.actuated for force in sent.thrust)
