"""Whatever comes off the bus becomes a row or a count, and never more counts than can be held."""

import msgspec
from hypothesis import example, given, settings
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.health import LogLine
from messages.payload import MEMBERS
from messages.pilot import PilotRequest
from messages.sensors import PressureSample
from messages.units import FARTHEST_NS
from services.recorder.core import LATEST_NS, UNKNOWN, Intake, RecordedRow

KEYS = [topic.key for topic in topics.ALL]
ENCODINGS = [topic.encoding for topic in topics.ALL]
ARRIVAL = 5_000_000_000
OFFSET = 1_700_000_000_000_000_000


def pressure(stamp_ns: int = 1, seq: int = 0, value: float = 101_325.0) -> bytes:
    sample = PressureSample(stamp_ns=stamp_ns, seq=seq, pressure=value)
    return msgspec.msgpack.encode(sample)


class Desk:
    """An intake, and what it tells."""

    def __init__(self, offset: int = 0) -> None:
        self._outbox = Outbox()
        self._intake = Intake(self._outbox, offset)
        self.log_hash = self._intake.log_hash

    def take(self, key: str, encoding: str, payload: bytes, arrival: int) -> RecordedRow | str:
        """The row, or the name under which its loss is counted."""
        found = self._intake.check(key, encoding, payload, arrival)
        if found is not None:
            assert not self._outbox.counts
            return self._intake.rows(key, found)[0]
        [(name, times)] = self._outbox.counts.items()
        assert times == 1
        self._outbox.counts.clear()
        return name


def take_pressure(intake: Desk, payload: bytes, arrival: int = ARRIVAL) -> RecordedRow | str:
    return intake.take(topics.PRESSURE.key, topics.PRESSURE.encoding, payload, arrival)


@settings(max_examples=100)
@given(
    key=st.sampled_from(KEYS) | st.text(max_size=200),
    encoding=st.sampled_from(ENCODINGS) | st.text(max_size=20),
    payload=st.binary(max_size=64)
    | st.recursive(
        st.none() | st.floats() | st.text(), lambda s: st.dictionaries(st.text(), s)
    ).map(msgspec.msgpack.encode),
    arrival=st.integers(min_value=-(2**65), max_value=2**65),
)
def test_garbage_is_refused_by_a_name_that_can_be_sent(
    key: str, encoding: str, payload: bytes, arrival: int
):
    reason = Desk(OFFSET).take(key, encoding, payload, arrival)
    assert isinstance(reason, str)
    assert reason.partition(":")[0] in {"wrong_type", "malformed", "unknown"}
    assert len(reason.encode()) < 1200


@given(
    stamp_ns=st.integers(min_value=-(2**63), max_value=2**64 - 1),
    seq=st.integers(min_value=-(2**63), max_value=2**64 - 1),
    value=st.floats(allow_nan=True, allow_infinity=True),
)
@example(stamp_ns=1, seq=2**40 + 2**20, value=1.0)
def test_a_row_fits_the_file_and_says_what_the_message_said(stamp_ns: int, seq: int, value: float):
    row = take_pressure(Desk(OFFSET), pressure(stamp_ns, seq, value))
    if isinstance(row, str):
        in_time = 0 <= stamp_ns + OFFSET <= LATEST_NS and abs(stamp_ns) <= FARTHEST_NS
        assert row == "malformed:sensor/pressure"
        assert not (in_time and 0 <= seq <= 2**53 and 0.0 <= value <= 1e9)
        return
    assert (row.log_ns, row.publish_ns) == (ARRIVAL + OFFSET, stamp_ns + OFFSET)
    assert row.sequence == seq % 2**32
    assert msgspec.json.decode(row.data, type=PressureSample) == PressureSample(
        stamp_ns=stamp_ns, seq=seq, pressure=value
    )


def test_a_flood_of_invented_keys_ends_up_under_one_name():
    intake = Desk()
    names = {intake.take(f"nobody/{n}", "", b"", 0) for n in range(10 * UNKNOWN)}
    assert len(names) == UNKNOWN + 1
    assert "unknown:others" in names


def line(service: str) -> bytes:
    return msgspec.msgpack.encode(LogLine(stamp_ns=1, service=service, level="info", text=""))


def test_a_family_has_room_for_members_but_not_for_a_flood():
    """And garbage takes no room."""
    intake, names = Desk(), [f"log/s{n}" for n in range(3 * MEMBERS)]
    refused = {intake.take(name, topics.LOG.encoding, b"", 0) for name in names}
    assert refused == {"malformed:log/*"}
    taken = [intake.take(key, topics.LOG.encoding, line(key[4:]), 0) for key in names]
    assert sum(isinstance(row, RecordedRow) for row in taken) == MEMBERS
    assert {row for row in taken if isinstance(row, str)} == {"too_many_keys:log/*"}
    assert isinstance(intake.take("log/s0", topics.LOG.encoding, line("s0"), 0), RecordedRow)


def test_a_line_in_the_name_of_another_service_is_not_recorded_as_its_own():
    intake = Desk()
    assert intake.take("log/camera", topics.LOG.encoding, line("control"), 0) == "misnamed:log/*"


Heard = tuple[str, int, int]


def hash_of(heard: list[Heard]) -> str:
    """Hash of requests and pressure samples: (which, stamp, arrival)."""
    intake = Desk()
    for which, stamp, arrival in heard:
        if which == "pressure":
            assert isinstance(take_pressure(intake, pressure(stamp), arrival), RecordedRow)
        else:
            request = msgspec.msgpack.encode(PilotRequest(stamp_ns=stamp, id="1", kind="arm"))
            topic = topics.PILOT_REQUEST
            assert isinstance(intake.take(topic.key, topic.encoding, request, arrival), RecordedRow)
    return intake.log_hash()


heard_lists = st.lists(
    st.tuples(st.sampled_from(["pressure", "request"]), st.integers(0, 3), st.integers(0, 3)),
    max_size=6,
)


@given(one=heard_lists, other=heard_lists)
@example(one=[("pressure", 1, 1)], other=[("pressure", 1, 2)])
def test_the_hash_is_of_what_was_heard_in_its_order(one: list[Heard], other: list[Heard]):
    assert (hash_of(one) == hash_of(other)) == (one == other)
    assert (hash_of(one) == hash_of(one[::-1])) == (one == one[::-1])


def test_what_is_refused_is_not_hashed():
    intake, untouched = Desk(), Desk()
    take_pressure(intake, b"garbage")
    intake.take("nobody/knows", "", b"", 0)
    assert intake.log_hash() == untouched.log_hash()
