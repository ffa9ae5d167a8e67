"""Two machines, two clocks: stamps are local wherever they are read, and nothing old passes."""

from collections import Counter
from typing import Any

import msgspec
import pytest
from hypothesis import example as case
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import inspect

from messages import topics
from messages.events import Outbox
from messages.link import Clock, ClockPong
from messages.message import Message
from messages.topic import Direction, Side
from messages.units import DURATION, STAMP, DurationNs, Stamp, Text
from services.link_monitor.core import LinkMonitor
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.clock_offset import ABOUT_CLOCKS, SILENT_NS, ClockOffset, mover
from services.runtime.node.gate import Gate
from services.runtime.node.ports import Inbox, Latest
from tests.support.messages import enveloped, example
from tests.support.said import sticks

MS, SECOND = 1_000_000, 1_000_000_000
GATEWAY = ServiceSpec(sides=["topside", "drone"], gateway=True)


def joined(clocks: dict[str, Skew]) -> VirtualHost:
    host, stack = VirtualHost(clocks), Stack(link="tether")
    host.add("tether", GATEWAY, stack)
    every = Registry.read()
    monitor = every.only({"link_monitor": every["link_monitor"]})
    host.add_all(monitor.apart(), stack)
    return host


def teach(clock_offset: ClockOffset, ahead: int, bound: int, now: int = 0) -> None:
    """The link monitor's word on the drone's clock, heard on board."""
    clock = example(Clock, offset_ns=ahead, bound_ns=bound)
    clock_offset.learn(clock, now)


SHIFTS = st.integers(-300, 300)  # [ms] what the clock is taken to be wrong by


@settings(max_examples=200)
@given(SHIFTS, SHIFTS, st.integers(0, 100), st.integers(0, 1000))
@case(-200, 200, 0, 350)  # its stamp seems newer, or older, than it is
@case(200, -200, 0, 350)
def test_better_knowledge_of_the_clock_lets_no_older_message_pass_and_lengthens_no_life(
    error: int, better: int, earlier: int, age: int
) -> None:
    clock_offset, counts = ClockOffset("drone"), Counter[str]()
    inbox = Inbox("pilot/command", 8, lambda: 0, Outbox(counts))
    gate = Gate(topics.PILOT_COMMAND, Outbox(counts), clock_offset)
    port = Latest(topics.PILOT_COMMAND, inbox, gate, Outbox(counts))
    teach(clock_offset, error * MS, abs(error) * MS, SECOND)
    inbox.store(enveloped(topics.PILOT_COMMAND, sticks(SECOND)))
    newest = port.newest(SECOND + 20 * MS)
    teach(clock_offset, better * MS, abs(better) * MS, SECOND)
    assert port.fresh(SECOND + age * MS) is None or age <= 300
    late = enveloped(topics.PILOT_COMMAND, sticks(SECOND - earlier * MS))
    assert newest is None or gate.admit(late, SECOND + 40 * MS) is None
    assert counts["lost:pilot/command"] == 0
    next_one = enveloped(topics.PILOT_COMMAND, sticks(SECOND + 20 * MS, ttl_ms=1000.0))
    assert gate.admit(next_one, SECOND + 40 * MS) is not None


@given(ahead=st.integers(-(10**14), 10**14), drift=st.floats(-9e-5, 9e-5))
def test_a_command_arrives_with_its_stamp_in_the_drones_own_time(ahead: int, drift: float) -> None:
    skew = Skew(ahead, drift)
    host = joined({"drone": skew})
    pilot, drone = host.node("pilot", ["topside"]), host.node("drone", ["drone"])
    heard: list[tuple[int, int]] = []
    publisher = pilot.publisher(topics.PILOT_COMMAND)
    pilot.every(50.0, lambda now: publisher.put(sticks(now)))
    drone.each(topics.PILOT_COMMAND, lambda m, now: heard.append((m.stamp_ns, now)))
    host.run(3 * SECOND)
    assert len(heard) > 100
    for stamp, now in heard:
        # The profile takes 1 ms and a bit; what the clocks may be off by is the round trip.
        assert -3 * MS <= now - stamp <= 8 * MS
    assert drone.counts["unsynchronised:pilot/command"] > 0  # before the first answer


# Stamps of the other machine's clock: both sides agree, and what is not known is not guessed.


AHEAD = st.integers(-(10**15), 10**15)  # [ns] drone's clock minus the topside's
STAMPS = st.integers(0, 10**15)


def clock(offset: int | None, bound: int | None = 0) -> Clock:
    return example(Clock, offset_ns=offset, bound_ns=bound)


def told(side: Side, ahead: int, bound: int = 0, now: int = 0) -> ClockOffset:
    offset = ClockOffset(side)
    offset.learn(clock(ahead, bound), now)
    return offset


@given(AHEAD, STAMPS)
def test_both_sides_read_the_same_instant(ahead: int, instant: int) -> None:
    """`instant` [ns] by the topside's clock; the drone's shows `ahead` more."""
    topside, drone = told("topside", ahead), told("drone", ahead)
    assert drone.local_ns(topics.PILOT_COMMAND, instant) == instant + ahead
    assert topside.local_ns(topics.STATE, instant + ahead) == instant
    assert topside.ahead_ns == -(drone.ahead_ns or 0)


@given(st.integers(0, 10**9), STAMPS, st.integers(0, 10**13), st.integers(0, 10**13))
def test_knowledge_ages_by_the_drift_of_two_crystals(
    bound: int, learnt: int, earlier: int, later: int
) -> None:
    offset = told("drone", 0, bound, learnt)
    first, second = sorted((learnt + earlier, learnt + later))
    assert bound <= offset.bound_ns(first) <= offset.bound_ns(second)
    assert offset.bound_ns(second) == bound + round(1e-4 * (second - learnt))
    assert offset.bound_ns(learnt - 1) == bound  # a clock that is looked at before it was learnt


@pytest.mark.parametrize("lost", [clock(None, 5), clock(5, None), clock(None, None)])
def test_a_clock_that_is_not_known_any_more_is_not_used(lost: Clock) -> None:
    offset = told("drone", 1000)
    offset.learn(lost, 1)
    assert offset.ahead_ns is None
    assert offset.local_ns(topics.PILOT_COMMAND, 7) is None


# Two topsides have two clocks: stamps are converted by the clock of who sent them.


ANN, BOB = 1, 2  # sources
NOW = 1_000_000 * SECOND
ahead = st.integers(-900_000 * SECOND, 900_000 * SECOND)  # [ns] the drone's clock minus a topside's


def clock_of(source: int, offset: int, epoch: int) -> Clock:
    return example(Clock, offset_ns=offset, bound_ns=MS, source=source, epoch=epoch)


@given(ahead, ahead, st.lists(st.sampled_from((ANN, BOB)), max_size=30), st.sampled_from((0, 3)))
def test_both_pilots_commands_are_in_time(ann: int, bob: int, said: list[int], bobs: int) -> None:
    """Also of one who was never in control."""
    offset, counts = ClockOffset("drone"), Counter[str]()
    gate = Gate(topics.PILOT_COMMAND, Outbox(counts), offset)
    theirs, epoch = {ANN: ann, BOB: bob}, {ANN: 7, BOB: bobs}
    for who in (BOB, ANN):
        offset.learn(clock_of(who, theirs[who], epoch[who]), NOW)
    for k, who in enumerate(said):
        now = NOW + k * 20 * MS
        offset.learn(clock_of(who, theirs[who], epoch[who]), now)
        assert offset.ahead_ns == -ann, "the newest epoch is in control"
        for one, ahead_ns in theirs.items():
            sent = sticks(now - 5 * MS - ahead_ns, epoch=epoch[one], seq=k)
            message = gate.admit(enveloped(topics.PILOT_COMMAND, sent), now)
            assert message is not None, counts
            assert message.stamp_ns == now - 5 * MS


def test_control_and_silence_move_the_clock_in_force() -> None:
    offset = ClockOffset("drone")
    offset.learn(clock_of(ANN, 10, 0), NOW)
    assert offset.of(99).ahead_ns == -10, "its clock does not name its new epoch yet"
    assert (offset.bound_ns(NOW + 60 * SECOND) > MS, offset.ahead_ns) == (True, -10)
    offset.learn(clock_of(BOB, 20, 0), NOW)
    assert offset.ahead_ns == -10, "nobody has control: the first stays"
    offset.learn(clock_of(BOB, 20, 5), NOW)
    assert offset.ahead_ns == -20
    offset.learn(clock_of(ANN, 10, 6), NOW + SILENT_NS)
    assert offset.ahead_ns == -10
    offset.learn(clock_of(BOB, 20, 5), NOW + 2 * SILENT_NS + 1)
    assert offset.ahead_ns == -20, "the other one is gone"


@given(ahead, ahead)
def test_a_link_monitor_takes_only_the_answers_to_its_own_pings(ann: int, bob: int) -> None:
    monitor = LinkMonitor(Outbox(), source=ANN)
    for k in range(10):
        now = NOW + k * 200 * MS
        for source, ahead_ns in ((ANN, ann), (BOB, bob)):
            heard = now + 10 * MS
            answer = ClockPong(
                stamp_ns=heard, ping_ns=now - ahead_ns, heard_ns=heard, source=source
            )
            monitor.pong(answer, now - ann + 20 * MS)
    told = monitor.ping(NOW - ann + 3 * SECOND)
    assert told.offset_ns is not None
    assert told.bound_ns is not None
    assert abs(told.offset_ns - ann) <= told.bound_ns <= 11 * MS
    assert not monitor.outbox.counts
    assert told.source == ANN


def test_the_clock_names_the_epoch_of_its_own_pilot() -> None:
    monitor = LinkMonitor(Outbox(), source=ANN)
    monitor.command(sticks(1, epoch=4), 1)
    assert monitor.ping(2).epoch == 4


@pytest.mark.parametrize(
    ("side", "crosses"), [("topside", Direction.UP), ("drone", Direction.DOWN)]
)
def test_own_stamps_stay_as_they_are_and_those_of_either_clock_are_not_read(
    side: Side, crosses: Direction
) -> None:
    """What crosses concerns the other side alone, and clocks carry their own time."""
    offset = told(side, 1000)
    for topic in topics.ALL:
        both, comes = topic.way is Direction.BOTH, topic.way is crosses
        about_clocks = topic.message in ABOUT_CLOCKS
        expected = None if both else 7 - (offset.ahead_ns or 0) * comes
        assert offset.local_ns(topic, 7) == expected
        assert offset.judges(topic) == (not both and not about_clocks)
        assert offset.concerns(topic) == (comes and not about_clocks)


# Every stamp of a message is moved, and nothing else is touched.


def whole_numbers(
    kind: inspect.Type, name: str = "", depth: int = -1
) -> list[tuple[str, inspect.Type, int]]:
    """Every whole number within a type, with the name of its field and how deep that is."""
    match kind:
        case inspect.IntType() | inspect.Metadata():
            return [(name, kind, depth)]
        case inspect.UnionType():
            inner = [(name, each, depth) for each in kind.types]
        case inspect.TupleType():
            inner = [(name, each, depth + 1) for each in kind.item_types]
        case inspect.VarTupleType() | inspect.ListType():
            inner = [(name, kind.item_type, depth + 1)]
        case inspect.DictType():
            inner = [(name, kind.value_type, depth + 1)]
        case inspect.StructType():
            inner = [(field.name, field.type, depth + 1) for field in kind.fields]
        case _:
            inner = []
    return [found for each, of, at in inner for found in whole_numbers(of, each, at)]


def says(kind: inspect.Type, *what: object) -> bool:
    return isinstance(kind, inspect.Metadata) and kind.extra in what


class Several(Message, frozen=True, kw_only=True):
    """Stamps at all places where one may stand."""

    maybe_ns: Stamp | None = None
    lasted_ns: DurationNs = 9
    text: Text = ""


def plain(message: Message) -> Any:
    return msgspec.json.decode(msgspec.json.encode(message))


@pytest.mark.parametrize("full", [False, True])
def test_every_stamp_is_moved_and_nothing_else(full: bool) -> None:
    for kind in dict.fromkeys([*(topic.message for topic in topics.ALL), Several]):
        sent = example(kind, 10**15, full=full)
        before, numbers = plain(sent), whole_numbers(inspect.type_info(kind))
        stamps = {name for name, of, depth in numbers if says(of, STAMP) and depth == 0}
        mover(kind)(sent, 7)
        assert plain(sent) == {
            name: value - 7 if name in stamps and value is not None else value
            for name, value in before.items()
        }
        mover(kind)(sent, -7)
        assert plain(sent) == before


def test_nanoseconds_say_whether_they_are_a_moment_or_a_duration_and_no_moment_is_deeper() -> None:
    """Than a field: it would not be converted. The link's status holds the sounder's newest word,
    and crosses in both directions: it is not converted."""
    deeper = set[str]()
    for topic in topics.ALL:
        for name, kind, depth in whole_numbers(inspect.type_info(topic.message)):
            assert says(kind, STAMP, DURATION) == name.endswith("_ns"), name
            deeper |= {topic.key} if says(kind, STAMP) and depth else set()
    assert deeper == {topics.LINK.key}
    assert topics.LINK.way is Direction.BOTH
