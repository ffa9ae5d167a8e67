"""The door of every port: whatever arrives, only whole, ordered, timely messages get in."""

from collections import Counter
from typing import get_args

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.health import Health
from messages.link import Clock
from messages.pilot import PilotCommand, PilotRequest, RequestKind
from services.runtime.bus.envelope import Envelope
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.gate import Gate, Gates
from tests.support.messages import enveloped, example
from tests.support.said import sticks

NOW = 10**12
MS = 1_000_000
TYPE = topics.PILOT_COMMAND.encoding
JITTER = 100 * MS  # [ns] the most that a stamp may lie ahead; it adds to the life of a command


def command(stamp_ns: int = NOW, seq: int = 0, ttl_ms: float = 300.0, epoch: int = 0) -> Envelope:
    return enveloped(topics.PILOT_COMMAND, sticks(stamp_ns, seq=seq, ttl_ms=ttl_ms, epoch=epoch))


def gate() -> tuple[Gate[PilotCommand], Counter[str]]:
    counts: Counter[str] = Counter()
    return Gate(topics.PILOT_COMMAND, Outbox(counts)), counts


def teach(offset: ClockOffset, ahead: int, bound: int, now: int) -> None:
    """On the drone: the topside's clock is so far ahead [ns], or this [ns] more or less."""
    offset.learn(example(Clock, offset_ns=-ahead, bound_ns=bound), now)


def known(ahead: int, bound: int, now: int) -> ClockOffset:
    offset = ClockOffset("drone")
    teach(offset, ahead, bound, now)
    return offset


@given(st.binary(max_size=200))
def test_no_bytes_whatever_get_in_or_raise(payload: bytes) -> None:
    door, counts = gate()
    assert door.admit(Envelope("pilot/command", payload, TYPE), NOW) is None
    assert counts["malformed:pilot/command"] == 1


def test_another_type_on_our_key_is_refused_unopened() -> None:
    door, counts = gate()
    other = Envelope("pilot/command", command().payload, "application/msgpack;Truth")
    assert door.admit(other, NOW) is None
    assert counts == {"wrong_type:pilot/command": 1}


@given(st.integers(-JITTER, JITTER) | st.integers(-2, 2), st.none() | st.integers(0, 100 * MS))
def test_no_command_lives_longer_by_a_stamp_from_the_future(more: int, bound: int | None) -> None:
    """`bound` [ns] is what the other machine's clock is known to; None: there is one clock."""
    counts, ahead = Counter[str](), JITTER + (bound or 0) + more
    offset = None if bound is None else known(0, bound, NOW)
    door = Gate(topics.PILOT_COMMAND, Outbox(counts), offset)
    admitted = door.admit(command(NOW + ahead), NOW)
    assert (admitted is not None) == (more <= 0)
    assert counts["from_future:pilot/command"] == (admitted is None)
    if admitted is None and not bound:  # nor does it shut the door for the rest
        assert door.admit(command(NOW), NOW) is not None


@given(st.integers(0, 2 * NOW), st.sampled_from(get_args(RequestKind)))
def test_before_the_clocks_are_known_only_events_are_heard(stamp: int, kind: RequestKind) -> None:
    """Nothing but the age of a message hangs on the clocks, and an event has none: a stop is a stop
    whenever it was pressed. What the age of a command is, nobody can say."""
    clock_offset, counts = ClockOffset("drone"), Counter[str]()
    events = Gate(topics.PILOT_REQUEST, Outbox(counts), clock_offset)
    request = PilotRequest(stamp_ns=stamp, id="stop-1", kind=kind)
    assert events.admit(enveloped(topics.PILOT_REQUEST, request), NOW) == request
    commands = Gate(topics.PILOT_COMMAND, Outbox(counts), clock_offset)
    assert commands.admit(command(stamp), NOW) is None
    assert counts == {"unsynchronised:pilot/command": 1}


def test_events_of_two_senders_do_not_shut_each_other_out() -> None:
    counts: Counter[str] = Counter()
    door = Gate(topics.PILOT_REQUEST, Outbox(counts))
    for stamp, seq, who in ((50, 9, "pad"), (10, 0, "ask"), (60, 10, "pad")):
        message = PilotRequest(stamp_ns=stamp, seq=seq, id=f"{who}-{seq}", kind="stop")
        assert door.admit(enveloped(topics.PILOT_REQUEST, message), NOW)
    assert counts == {}


class Even:
    """Admits even epochs."""

    def __init__(self) -> None:
        self.told: list[tuple[int, int]] = []

    def admits(self, epoch: int, now: int) -> bool:  # noqa: ARG002
        return epoch % 2 == 0

    def heard(self, epoch: int, now: int) -> None:
        self.told.append((epoch, now))


@given(st.lists(st.tuples(st.integers(0, 6), st.booleans()), max_size=40))
def test_only_what_the_authority_admits_and_what_is_in_time_is_obeyed_and_told(
    events: list[tuple[int, bool]],
) -> None:
    door, counts = gate()
    door.authority = authority = Even()
    obeyed: list[tuple[int, int]] = []
    for k, (epoch, late) in enumerate(events):
        now = NOW + k
        admitted = door.admit(command(now - late * 10**9, k, epoch=epoch), now)
        assert (admitted is not None) == (epoch % 2 == 0 and not late)
        if admitted is not None:
            obeyed.append((epoch, now))
    assert authority.told == obeyed
    assert counts["wrong_epoch:pilot/command"] == sum(epoch % 2 for epoch, _ in events)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 9)), max_size=40))
def test_whatever_is_not_newer_is_refused_by_its_reason_and_every_gap_is_counted(
    arrivals: list[tuple[int, int]],
) -> None:
    door, counts = gate()
    newest: tuple[int, int] | None = None
    expected: Counter[str] = Counter()
    for stamp, seq in arrivals:
        if newest is not None and (stamp, seq) == newest:
            expected["duplicated:pilot/command"] += 1
        elif newest is not None and stamp < newest[0]:
            expected["reordered:pilot/command"] += 1
        else:
            if newest is not None and seq > newest[1] + 1:
                expected["lost:pilot/command"] += seq - newest[1] - 1
            newest = stamp, seq
            assert door.admit(command(NOW + stamp, seq), NOW) is not None
            continue
        assert door.admit(command(NOW + stamp, seq), NOW) is None
    assert counts == expected
    assert door.admitted == (newest is not None)


ahead = st.integers(-(10**12), 10**12)
bound = st.integers(0, 200 * MS)


@given(ahead, bound, st.integers(0, 600) | st.just(300), st.integers(-2, 2))
def test_a_command_is_as_old_as_it_can_be(ahead: int, bound: int, ttl_ms: int, more: int) -> None:
    """It acts if it is in time even though the clock is known no better."""
    counts: Counter[str] = Counter()
    door = Gate(topics.PILOT_COMMAND, Outbox(counts), known(ahead, bound, NOW))
    age = ttl_ms * MS - bound + more
    admitted = door.admit(command(NOW + ahead - age, ttl_ms=float(ttl_ms)), NOW)
    in_future = -age > JITTER + bound
    assert (admitted is not None) == (more <= 0 and not in_future)
    if admitted is not None:
        assert admitted.stamp_ns == NOW - age
        assert door.bound_ns == bound
    assert counts["expired:pilot/command"] == (more > 0 and not in_future)


@given(ahead, bound, st.integers(1, 10**9), st.integers(-2, 2) | st.integers(-(10**9), 10**9))
def test_an_older_stamp_is_of_a_restarted_clock_only_if_it_must_be(
    ahead: int, bound: int, earlier: int, more: int
) -> None:
    counts: Counter[str] = Counter()
    offset = known(ahead, 0, NOW)
    door = Gate(topics.PILOT_COMMAND, Outbox(counts), offset, onlooker=True)
    sent = NOW + ahead
    assert door.admit(command(sent, seq=7), NOW) is not None
    # By what is learnt of the clock now, the newest would be from further ahead than jitter.
    teach(offset, ahead - JITTER - bound - more, bound, NOW)
    again = door.admit(command(sent - earlier, seq=earlier), NOW)
    still_ahead = JITTER + bound + more - earlier > JITTER + bound
    assert (again is not None) == (more > 0 and not still_ahead)
    if still_ahead:
        assert counts == {"from_future:pilot/command": 1}
    else:
        assert counts == ({} if more > 0 else {"reordered:pilot/command": 1})


def health(stamp_ns: int, seq: int, service: str) -> bytes:
    said = example(Health, stamp_ns, seq=seq, service=service)
    return msgspec.msgpack.encode(said)


heard = st.lists(
    st.tuples(
        st.sampled_from(["health/a", "health/b", "health/c", "health/", "health/B!", "state"]),
        st.integers(0, 5),
        st.integers(0, 9),
        st.sampled_from([topics.HEALTH.encoding, topics.HEALTH.encoding, TYPE]),
        st.booleans(),
    ),
    max_size=40,
)


@given(heard)
def test_a_family_has_a_door_for_each_member(heard: list[tuple[str, int, int, str, bool]]) -> None:
    """Counted under a member's own name once it was admitted, until then under the family's."""
    counts: Counter[str] = Counter()
    family = Gates(topics.HEALTH, Outbox(counts))
    alone: dict[str, Gate[Health]] = {}
    expected: Counter[str] = Counter()
    for key, stamp, seq, encoding, is_whole in heard:
        payload = health(NOW + stamp, seq, key.partition("/")[2]) if is_whole else b"garbage"
        envelope = Envelope(key, payload, encoding)
        found = family.admit(envelope, NOW)
        if key not in {"health/a", "health/b", "health/c"}:
            assert found is None
            expected["unknown_key:health/*"] += 1
            continue
        door = alone.setdefault(key, Gate(topics.HEALTH, Outbox(expected)))
        assert found == door.admit(envelope, NOW)
    assert counts == expected


@pytest.mark.parametrize("is_onlooker", [False, True])
def test_a_family_has_sixty_four_members_and_counts_the_rest(is_onlooker: bool) -> None:
    counts: Counter[str] = Counter()
    family = Gates(topics.HEALTH, Outbox(counts), onlooker=is_onlooker)

    def admits(member: int, number: int) -> bool:
        said = health(NOW + number, number, f"s{member}")
        envelope = Envelope(f"health/s{member}", said, topics.HEALTH.encoding)
        return family.admit(envelope, NOW) is not None

    for number in (0, 1):
        assert [k for k in range(80) if admits(k, number)] == [*range(64)]
    assert counts == {"too_many_keys:health/*": 2 * 16}


@given(st.integers(0, 10**9))
def test_only_an_onlooker_of_all_doors_gets_what_is_too_old(age: int) -> None:
    for is_onlooker in (False, True):
        door = Gates(topics.PILOT_COMMAND, Outbox(), onlooker=is_onlooker)
        found = door.admit(command(NOW - age), NOW)
        assert (found is not None) == (is_onlooker or age <= 300 * MS)
    by_default = Gates(topics.PILOT_COMMAND, Outbox()).admit(command(NOW - age), NOW)
    assert (by_default is not None) == (age <= 300 * MS)


@given(ahead, st.integers(0, 10**13))
def test_what_either_side_may_have_sent_has_no_stamp_to_judge(ahead: int, stamp: int) -> None:
    """With one clock it has; with two it may be of either, and so it is never moved."""
    envelope = Envelope("health/a", health(stamp, 0, "a"), topics.HEALTH.encoding)
    for offset in (known(ahead, 0, NOW), ClockOffset("drone")):
        found = Gates(topics.HEALTH, Outbox(), offset).admit(envelope, NOW)
        assert found is not None
        assert found.stamp_ns == stamp
    alone = Gates(topics.HEALTH, Outbox()).admit(envelope, NOW)
    assert (alone is not None) == (stamp <= NOW + JITTER)
