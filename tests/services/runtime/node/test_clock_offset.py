"""Two machines, two clocks: stamps are local wherever they are read, and nothing old passes."""

from collections import Counter

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.link import Clock, ClockPong
from messages.pilot import PilotCommand
from messages.topic import AnyTopic, Direction, Side
from services.link_monitor.core import LinkMonitor
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.clock_offset import ABOUT_CLOCKS, SILENT_NS, ClockOffset
from services.runtime.node.gate import Gate
from services.runtime.node.ports import Inbox, Latest
from tests.support.messages import example

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


def envelope(message: PilotCommand) -> Envelope:
    topic = topics.PILOT_COMMAND
    return Envelope(topic.key, msgspec.msgpack.encode(message), topic.encoding)


@given(error=st.integers(-200, 200), better=st.integers(-200, 200), earlier=st.integers(0, 100))
@settings(max_examples=100, deadline=None)
def test_better_knowledge_of_the_clock_lets_no_older_message_pass_a_newer_one(
    error: int, better: int, earlier: int
) -> None:
    """`error` and `better` [ms] are what the clock is taken to be wrong by, before and after."""
    clock_offset, counts = ClockOffset("drone"), Counter[str]()
    gate = Gate(topics.PILOT_COMMAND, Outbox(counts), clock_offset)
    teach(clock_offset, error * MS, abs(error) * MS, SECOND)
    newest = gate.admit(envelope(command(SECOND)), SECOND + 20 * MS)
    teach(clock_offset, better * MS, abs(better) * MS, SECOND)
    older = gate.admit(envelope(command(SECOND - earlier * MS)), SECOND + 40 * MS)
    assert newest is None or older is None
    assert counts["lost:pilot/command"] == 0
    assert gate.admit(envelope(command(SECOND + 20 * MS, 1000.0)), SECOND + 40 * MS) is not None


@given(error=st.integers(-300, 300), better=st.integers(-300, 300), age=st.integers(0, 1000))
@settings(max_examples=200, deadline=None)
def test_better_knowledge_of_the_clock_lengthens_no_life(error: int, better: int, age: int) -> None:
    clock_offset, counts = ClockOffset("drone"), Counter[str]()
    gate = Gate(topics.PILOT_COMMAND, Outbox(counts), clock_offset)
    inbox = Inbox("pilot/command", 8, lambda: 0, Outbox(counts))
    newest = Latest(topics.PILOT_COMMAND, inbox, gate, Outbox(counts))
    teach(clock_offset, error * MS, abs(error) * MS, SECOND)
    inbox.store(envelope(command(SECOND)))
    newest.newest(SECOND)
    teach(clock_offset, better * MS, abs(better) * MS, SECOND)
    assert newest.fresh(SECOND + age * MS) is None or age <= 300


def command(now: int, ttl_ms: float = 300.0) -> PilotCommand:
    return PilotCommand(stamp_ns=now, surge=0.0, sway=0.0, heave=0.0, yaw=0.0, ttl_ms=ttl_ms)


@given(ahead=st.integers(-(10**14), 10**14), drift=st.floats(-9e-5, 9e-5))
@settings(max_examples=10, deadline=None)
def test_a_command_arrives_with_its_stamp_in_the_drones_own_time(ahead: int, drift: float) -> None:
    skew = Skew(ahead, drift)
    host = joined({"drone": skew})
    pilot, drone = host.node("pilot", ["topside"]), host.node("drone", ["drone"])
    heard: list[tuple[int, int]] = []
    publisher = pilot.publisher(topics.PILOT_COMMAND)
    pilot.every(50.0, lambda now: publisher.put(command(now)))
    drone.each(topics.PILOT_COMMAND, lambda m, now: heard.append((m.stamp_ns, now)))
    host.run(3 * SECOND)
    assert len(heard) > 100
    for stamp, now in heard:
        # The profile takes 1 ms and a bit; what the clocks may be off by is the round trip.
        assert -3 * MS <= now - stamp <= 8 * MS
    assert drone.counts["unsynchronised:pilot/command"] > 0  # before the first answer


@given(ahead=st.integers(-(10**14), 10**14), lag=st.integers(0, 400))
@settings(max_examples=20, deadline=None)
def test_a_command_is_never_older_than_its_time_to_live_when_it_acts(ahead: int, lag: int) -> None:
    """`lag` [ms] is how old it was when it entered the link."""
    host = joined({"drone": Skew(ahead)})
    pilot, drone = host.node("pilot", ["topside"]), host.node("drone", ["drone"])
    publisher = pilot.publisher(topics.PILOT_COMMAND)
    acted: list[int] = []

    def speak(now: int) -> None:
        publisher.put(command(now - lag * MS if now > 2 * SECOND else now))

    pilot.every(50.0, speak)
    newest = drone.latest(topics.PILOT_COMMAND)

    def act(_: int) -> None:
        message = newest.fresh(ahead + host.now)
        if message is not None:
            acted.append(host.now)
            spoken = (message.seq + 1) * 20 * MS
            true_stamp = spoken - lag * MS if spoken > 2 * SECOND else spoken
            assert host.now - true_stamp <= 300 * MS

    drone.every(100.0, act)
    host.run(4 * SECOND)
    assert bool([now for now in acted if now > 3 * SECOND]) == (lag < 290) or 285 <= lag <= 305


# Stamps of the other machine's clock: both sides agree, and what is not known is not guessed.


AHEAD = st.integers(-(10**15), 10**15)  # [ns] drone's clock minus the topside's
STAMPS = st.integers(0, 10**15)
ROWS = st.sampled_from(topics.ALL)


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


@given(ROWS, AHEAD, STAMPS)
def test_own_stamps_stay_as_they_are_and_those_of_either_clock_are_not_read(
    topic: AnyTopic, ahead: int, stamp: int
) -> None:
    own_ways: dict[Side, set[Direction]] = {
        "topside": {Direction.DOWN},
        "drone": {Direction.UP, Direction.STAY},
    }
    for side, own in own_ways.items():
        offset = told(side, ahead)
        if topic.way is Direction.BOTH:
            assert offset.local_ns(topic, stamp) is None
            assert not offset.judges(topic)
        elif topic.way in own:
            assert offset.local_ns(topic, stamp) == stamp
            assert not offset.concerns(topic)


@given(ROWS)
def test_what_crosses_concerns_one_side_only_and_clocks_carry_their_own_time(
    topic: AnyTopic,
) -> None:
    concerned = [side for side in ("topside", "drone") if ClockOffset(side).concerns(topic)]
    expected = {Direction.UP: ["topside"], Direction.DOWN: ["drone"]}.get(topic.way, [])
    assert concerned == ([] if topic.message in ABOUT_CLOCKS else expected)


@given(st.integers(0, 10**9), STAMPS, st.integers(0, 10**13), st.integers(0, 10**13))
def test_knowledge_ages_by_the_drift_of_two_crystals_and_never_gets_better_by_itself(
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


S = SECOND
ANN, BOB = 1, 2  # sources
NOW = 1_000_000 * S
ahead = st.integers(-900_000 * S, 900_000 * S)  # [ns] the drone's clock minus a topside's


def clock_of(source: int, offset: int, epoch: int) -> Clock:
    return example(Clock, offset_ns=offset, bound_ns=MS, source=source, epoch=epoch)


def admitted(gate: "Gate[PilotCommand]", sent: PilotCommand, now: int) -> PilotCommand | None:
    topic = topics.PILOT_COMMAND
    return gate.admit(Envelope(topic.key, msgspec.msgpack.encode(sent), topic.encoding), now)


@given(ahead, ahead, st.lists(st.sampled_from((ANN, BOB)), max_size=30), st.sampled_from((0, 3)))
def test_both_pilots_commands_are_in_time_whoever_speaks_last(
    ann: int, bob: int, said: list[int], bobs: int
) -> None:
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
            sent = PilotCommand(
                stamp_ns=now - 5 * MS - ahead_ns, surge=0, sway=0, heave=0, yaw=0,
                epoch=epoch[one], seq=k,
            )  # fmt: skip
            message = admitted(gate, sent, now)
            assert message is not None, counts
            assert message.stamp_ns == now - 5 * MS


def test_control_and_silence_move_the_clock_in_force() -> None:
    offset = ClockOffset("drone")
    offset.learn(clock_of(ANN, 10, 0), NOW)
    offset.learn(clock_of(BOB, 20, 0), NOW)
    assert offset.ahead_ns == -10, "nobody has control: the first stays"
    offset.learn(clock_of(BOB, 20, 5), NOW)
    assert offset.ahead_ns == -20
    offset.learn(clock_of(ANN, 10, 6), NOW + SILENT_NS)
    assert offset.ahead_ns == -10
    offset.learn(clock_of(BOB, 20, 5), NOW + 2 * SILENT_NS + 1)
    assert offset.ahead_ns == -20, "the other one is gone"


def test_one_topside_is_as_before_and_its_silence_changes_nothing() -> None:
    offset = ClockOffset("drone")
    offset.learn(clock_of(ANN, 10, 0), NOW)
    assert offset.of(99).ahead_ns == -10, "its clock does not name its new epoch yet"
    assert offset.bound_ns(NOW + 60 * S) > MS
    assert offset.ahead_ns == -10


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
    told = monitor.ping(NOW - ann + 3 * S)
    assert told.offset_ns is not None
    assert told.bound_ns is not None
    assert abs(told.offset_ns - ann) <= told.bound_ns <= 11 * MS
    assert not monitor.outbox.counts
    assert told.source == ANN


def test_the_clock_names_the_epoch_of_its_own_pilot() -> None:
    monitor = LinkMonitor(Outbox(), source=ANN)
    monitor.command(PilotCommand(stamp_ns=1, surge=0, sway=0, heave=0, yaw=0, epoch=4), 1)
    assert monitor.ping(2).epoch == 4
