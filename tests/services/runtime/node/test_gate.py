"""The door of every port: whatever arrives, only whole, ordered, timely messages get in."""

from collections import Counter
from typing import get_args

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.link import Clock
from messages.pilot import PilotCommand, PilotRequest, RequestKind
from services.runtime.bus.envelope import Envelope
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.gate import Authority, Gate

NOW = 10**12
MS = 1_000_000
TYPE = topics.PILOT_COMMAND.encoding
JITTER = 100 * MS  # [ns] the most that a stamp may lie ahead; it adds to the life of a command


def command(stamp_ns: int = NOW, seq: int = 0, ttl_ms: float = 300.0, epoch: int = 0) -> Envelope:
    message = PilotCommand(
        stamp_ns=stamp_ns, seq=seq, surge=0.0, sway=0.0, heave=0.0, yaw=0.0, ttl_ms=ttl_ms,
        epoch=epoch,
    )  # fmt: skip
    return Envelope("pilot/command", msgspec.msgpack.encode(message), TYPE)


def gate() -> tuple[Gate[PilotCommand], Counter[str]]:
    counts: Counter[str] = Counter()
    return Gate(topics.PILOT_COMMAND, counts), counts


@given(st.binary(max_size=200))
def test_no_bytes_whatever_get_in_or_raise(payload: bytes) -> None:
    door, counts = gate()
    assert door.admit(Envelope("pilot/command", payload, TYPE), NOW) is None
    assert counts["malformed:pilot/command"] == 1


def test_deeply_nested_bytes_are_only_malformed() -> None:
    door, counts = gate()
    assert door.admit(Envelope("pilot/command", b"\x91" * 100_000, TYPE), NOW) is None
    assert counts.total() == 1


def test_another_type_on_our_key_is_refused_unopened() -> None:
    door, counts = gate()
    other = Envelope("pilot/command", command().payload, "application/msgpack;Truth")
    assert door.admit(other, NOW) is None
    assert counts == {"wrong_type:pilot/command": 1}


def test_a_number_that_is_not_finite_is_refused() -> None:
    door, counts = gate()
    fields = msgspec.msgpack.decode(command().payload) | {"heave": float("nan")}
    bad = Envelope("pilot/command", msgspec.msgpack.encode(fields), TYPE)
    assert door.admit(bad, NOW) is None
    assert counts == {"malformed:pilot/command": 1}


@given(st.integers(0, 10**10), st.floats(0.0, 1000.0))
def test_a_command_older_than_its_time_to_live_never_gets_in(age: int, ttl_ms: float) -> None:
    door, counts = gate()
    admitted = door.admit(command(NOW - age, ttl_ms=ttl_ms), NOW)
    assert (admitted is not None) == (age <= ttl_ms * 1e6)
    assert counts["expired:pilot/command"] == (admitted is None)


def test_a_stamp_from_the_future_cannot_shut_the_door_for_the_rest() -> None:
    door, counts = gate()
    assert door.admit(command(NOW + 10**9), NOW) is None
    assert door.admit(command(NOW), NOW) is not None
    assert counts == {"from_future:pilot/command": 1}


@given(st.integers(-JITTER, JITTER) | st.integers(-2, 2), st.none() | st.integers(0, 100 * MS))
def test_no_command_lives_longer_by_a_stamp_from_the_future_than_jitter_explains(
    more: int, bound: int | None
) -> None:
    """`bound` [ns] is what the other machine's clock is known to; None: there is one clock."""
    counts, ahead = Counter[str](), JITTER + (bound or 0) + more
    clock_offset = None if bound is None else ClockOffset("drone")
    if clock_offset is not None:
        told = Clock(
            stamp_ns=0, offset_ns=0, bound_ns=bound, drift_ppm=None, rtt_ms=None,
            rtt_min_ms=None, answered_ms=None,
        )  # fmt: skip
        clock_offset.learn(told, NOW)
    admitted = Gate(topics.PILOT_COMMAND, counts, clock_offset).admit(command(NOW + ahead), NOW)
    assert (admitted is not None) == (more <= 0)
    assert counts["from_future:pilot/command"] == (admitted is None)


@given(st.integers(0, 2 * NOW), st.sampled_from(get_args(RequestKind)))
def test_before_the_clocks_are_known_events_are_heard_and_commands_are_not(
    stamp: int, kind: RequestKind
) -> None:
    """Nothing but the age of a message hangs on the clocks, and an event has none: a stop is a stop
    whenever it was pressed. What the age of a command is, nobody can say."""
    clock_offset, counts = ClockOffset("drone"), Counter[str]()
    events = Gate(topics.PILOT_REQUEST, counts, clock_offset)
    request = PilotRequest(stamp_ns=stamp, id="stop-1", kind=kind)
    encoded = msgspec.msgpack.encode(request)
    heard = events.admit(Envelope("pilot/request", encoded, topics.PILOT_REQUEST.encoding), NOW)
    assert heard == request
    assert Gate(topics.PILOT_COMMAND, counts, clock_offset).admit(command(stamp), NOW) is None
    assert counts == {"unsynchronised:pilot/command": 1}


@given(st.integers(-(10**12), 10**12), st.integers(1, 200 * MS))
def test_what_was_overtaken_is_refused_however_far_apart_the_clocks_are(
    ahead: int, earlier: int
) -> None:
    counts, offset = Counter[str](), ClockOffset("drone")
    told = Clock(
        stamp_ns=0, offset_ns=-ahead, bound_ns=0, drift_ppm=None, rtt_ms=None,
        rtt_min_ms=None, answered_ms=None,
    )  # fmt: skip
    offset.learn(told, NOW)
    door = Gate(topics.PILOT_COMMAND, counts, offset)
    newest = door.admit(command(NOW + ahead), NOW)
    assert newest is not None
    assert newest.stamp_ns == NOW
    assert door.admit(command(NOW + ahead - earlier), NOW) is None
    assert counts == {"reordered:pilot/command": 1}


def test_what_was_overtaken_or_doubled_is_refused_and_a_gap_is_counted() -> None:
    door, counts = gate()
    for stamp, seq in ((0, 0), (20, 1), (10, 7), (20, 1), (50, 5)):
        door.admit(command(NOW + stamp, seq), NOW)
    assert counts == {
        "reordered:pilot/command": 1,
        "duplicated:pilot/command": 1,
        "lost:pilot/command": 3,
    }


def test_a_restarted_publisher_is_heard_at_once() -> None:
    door, counts = gate()
    door.admit(command(NOW, seq=900), NOW)
    assert door.admit(command(NOW + 10, seq=0), NOW) is not None
    assert counts == {}


@settings(max_examples=100)
@given(st.lists(st.tuples(st.integers(-(10**9), 10**9), st.integers(0, 50)), max_size=60))
def test_admitted_stamps_never_run_backwards(arrivals: list[tuple[int, int]]) -> None:
    door, _ = gate()
    admitted = [door.admit(command(NOW + s, q, ttl_ms=1000.0), NOW) for s, q in arrivals]
    stamps = [message.stamp_ns for message in admitted if message is not None]
    assert stamps == sorted(stamps)


def test_events_of_two_senders_do_not_shut_each_other_out() -> None:
    counts: Counter[str] = Counter()
    door = Gate(topics.PILOT_REQUEST, counts)
    for stamp, seq, who in ((50, 9, "pad"), (10, 0, "ask"), (60, 10, "pad")):
        message = PilotRequest(stamp_ns=stamp, seq=seq, id=f"{who}-{seq}", kind="stop")
        payload = msgspec.msgpack.encode(message)
        assert door.admit(Envelope("pilot/request", payload, topics.PILOT_REQUEST.encoding), NOW)
    assert counts == {}


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 6)), max_size=40))
def test_only_epochs_from_the_one_in_force_to_the_one_granted_are_obeyed(
    events: list[tuple[bool, int]],
) -> None:
    """Grants and commands in any order; a grant counts from the first command of its epoch on."""
    door, counts = gate()
    door.authority = authority = Authority(1, 1)
    in_force, granted, refused = 1, 1, 0
    for k, (is_grant, epoch) in enumerate(events):
        if is_grant:
            authority.granted = granted = max(granted, epoch)
            continue
        admitted = door.admit(command(NOW + k, k, epoch=epoch), NOW + k)
        assert (admitted is not None) == (in_force <= epoch <= granted)
        if admitted is None:
            refused += 1
        else:
            in_force = epoch
    assert counts["wrong_epoch:pilot/command"] == refused


def test_with_one_clock_an_age_is_exact() -> None:
    assert gate()[0].bound_ns(NOW) == 0


def test_an_onlooker_sees_commands_that_are_too_old_to_act_on() -> None:
    door = Gate(topics.PILOT_COMMAND, Counter[str](), onlooker=True)
    assert door.admit(command(NOW - 10**9), NOW) is not None
