"""Two topsides have two clocks: stamps are converted by the clock of who sent them."""

from collections import Counter

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.link import Clock, ClockPing
from messages.pilot import PilotCommand, PilotRequest
from services.link_monitor.core import LinkMonitor, pong
from services.runtime.bus.envelope import Envelope
from services.runtime.node.clock_offset import SILENT_NS, ClockOffset
from services.runtime.node.gate import Gate
from tests.support.messages import example

MS, S = 1_000_000, 1_000_000_000  # [ns]
ANN, BOB = 1, 2  # sources
NOW = 1_000_000 * S
ahead = st.integers(-900_000 * S, 900_000 * S)  # [ns] the drone's clock minus a topside's


def clock(source: int, offset: int, epoch: int) -> Clock:
    return example(Clock, offset_ns=offset, bound_ns=MS, source=source, epoch=epoch)


def admitted(gate: "Gate[PilotCommand]", sent: PilotCommand, now: int) -> PilotCommand | None:
    topic = topics.PILOT_COMMAND
    return gate.admit(Envelope(topic.key, msgspec.msgpack.encode(sent), topic.encoding), now)


@given(ahead, ahead, st.lists(st.sampled_from((ANN, BOB)), max_size=30))
def test_both_pilots_commands_are_in_time_whoever_speaks_last(
    ann: int, bob: int, said: list[int]
) -> None:
    offset, counts = ClockOffset("drone"), Counter[str]()
    gate = Gate(topics.PILOT_COMMAND, Outbox(counts), offset)
    theirs, epoch = {ANN: ann, BOB: bob}, {ANN: 7, BOB: 3}
    for who in (BOB, ANN):
        offset.learn(clock(who, theirs[who], epoch[who]), NOW)
    for k, who in enumerate(said):
        now = NOW + k * 20 * MS
        offset.learn(clock(who, theirs[who], epoch[who]), now)
        assert offset.ahead_ns == -ann, "the newest epoch is in control"
        for one, ahead_ns in theirs.items():
            sent = PilotCommand(
                stamp_ns=now - 5 * MS - ahead_ns, surge=0, sway=0, heave=0, yaw=0,
                epoch=epoch[one], seq=k,
            )  # fmt: skip
            message = admitted(gate, sent, now)
            assert message is not None, counts
            assert message.stamp_ns == now - 5 * MS


@given(ahead, ahead)
def test_the_request_for_control_of_the_second_pilot_is_in_time(ann: int, bob: int) -> None:
    offset = ClockOffset("drone")
    offset.learn(clock(ANN, ann, 7), NOW)
    offset.learn(clock(BOB, bob, 0), NOW)
    counts, topic = Counter[str](), topics.PILOT_REQUEST
    gate = Gate(topic, Outbox(counts), offset)
    request = PilotRequest(stamp_ns=NOW - bob, id="a", kind="lease", epoch=0)
    heard = gate.admit(Envelope(topic.key, msgspec.msgpack.encode(request), topic.encoding), NOW)
    assert heard is not None, counts
    assert heard.stamp_ns == NOW


def test_control_and_silence_move_the_clock_in_force() -> None:
    offset = ClockOffset("drone")
    offset.learn(clock(ANN, 10, 0), NOW)
    offset.learn(clock(BOB, 20, 0), NOW)
    assert offset.ahead_ns == -10, "nobody has control: the first stays"
    offset.learn(clock(BOB, 20, 5), NOW)
    assert offset.ahead_ns == -20
    offset.learn(clock(ANN, 10, 6), NOW + SILENT_NS)
    assert offset.ahead_ns == -10
    offset.learn(clock(BOB, 20, 5), NOW + 2 * SILENT_NS + 1)
    assert offset.ahead_ns == -20, "the other one is gone"


def test_one_topside_is_as_before_and_its_silence_changes_nothing() -> None:
    offset = ClockOffset("drone")
    offset.learn(clock(ANN, 10, 0), NOW)
    assert offset.of(99).ahead_ns == -10, "its clock does not name its new epoch yet"
    assert offset.bound_ns(NOW + 60 * S) > MS
    assert offset.ahead_ns == -10


@given(ahead, ahead)
def test_a_link_monitor_takes_only_the_answers_to_its_own_pings(ann: int, bob: int) -> None:
    monitor = LinkMonitor(Outbox(), source=ANN)
    for k in range(10):
        now = NOW + k * 200 * MS
        for source, ahead_ns in ((ANN, ann), (BOB, bob)):
            ping = ClockPing(stamp_ns=now - ahead_ns, source=source)
            monitor.pong(pong(ping, now + 10 * MS), now - ann + 20 * MS)
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
