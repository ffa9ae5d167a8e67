"""The ring keeps the newest rows, in order, within its time and its memory, and counts the rest."""

from hypothesis import given
from hypothesis import strategies as st

from messages.link import LatencyBudget
from messages.pilot import PilotRequest
from messages.sensors import LeakSample
from messages.vehicle import VehicleStatus
from services.recorder.core import RecordedRow
from services.recorder.foxglove.channel import NamedSchema
from services.recorder.ring import ROW_BYTES, Ring, trigger

SECOND = 1_000_000_000
SCHEMA = NamedSchema("X", b"{}")


def row(number: int, log_ns: int, size: int, *, is_view: bool = False) -> RecordedRow:
    return RecordedRow("key", SCHEMA, b"x" * size, log_ns, log_ns, number, is_view)


@given(
    seconds=st.floats(min_value=0.1, max_value=10.0),
    most=st.integers(min_value=1, max_value=20_000),
    rows=st.lists(
        st.tuples(
            st.integers(min_value=-SECOND // 10, max_value=SECOND),  # clocks also run backwards
            st.integers(min_value=0, max_value=2000),
            st.booleans(),
        ),
        max_size=60,
    ),
)
def test_it_keeps_the_newest_rows_within_its_bounds(
    seconds: float, most: int, rows: list[tuple[int, int, bool]]
):
    ring, now = Ring(seconds, most), 10 * SECOND
    told, every, old = 0, list[RecordedRow](), 0
    for number, (step, size, is_view) in enumerate(rows):
        now += step
        every.append(row(number, now, size, is_view=is_view))
        told += ring.keep(every[-1])
        old = max(old, *(n + 1 for n, r in enumerate(every) if now - r.log_ns > seconds * 1e9), 0)
    kept = ring.release()
    assert not ring.holds
    assert kept == every[len(every) - len(kept) :]
    if kept:
        assert kept[-1].log_ns - kept[0].log_ns <= seconds * 1e9 + 1
    memory = sum(ROW_BYTES + len(r.data) for r in kept)
    assert memory <= most or len(kept) == 1
    # Whatever is neither kept nor too old was dropped for want of memory, and is counted.
    assert told <= sum(not r.is_view for r in every[: len(every) - len(kept)])
    if len(every) - len(kept) > old:
        dropped = every[old : len(every) - len(kept)]
        assert told >= sum(not r.is_view for r in dropped)
    assert ring.release() == []


def test_without_seconds_nothing_is_held_back():
    assert not Ring(0.0, 1e6).holds


def status(**changes: object) -> VehicleStatus:
    return VehicleStatus(**({"stamp_ns": 0, "activity": "ready", "armed": False} | changes))  # type: ignore[arg-type]


def test_arming_a_request_an_alarm_and_a_failsafe_begin_a_recording():
    assert trigger(status()) is None
    assert trigger(LeakSample(stamp_ns=0, wet=False)) is None
    assert trigger(status(armed=True)) == "the drone is armed"
    assert trigger(status(failsafe="leak")) == "failsafe leak"
    assert trigger(status(conditions=("too_hot",))) == "the drone noticed too_hot"
    asked = PilotRequest(stamp_ns=0, id="x", kind="light", value=0.5)
    assert trigger(asked) == "the pilot asks for light"
    assert trigger(PilotRequest(stamp_ns=0, id="x", kind="lease")) is None
    quiet = LatencyBudget(
        stamp_ns=0, down=None, up=None, stick_to_thruster_ms=None, sensor_to_screen_ms=None,
        bound_ms=None,
    )  # fmt: skip
    assert trigger(quiet) is None
    loud = LatencyBudget(
        stamp_ns=0, down=None, up=None, stick_to_thruster_ms=None, sensor_to_screen_ms=None,
        bound_ms=None, alarm="no reply for 2 s",
    )  # fmt: skip
    assert trigger(loud) == "link alarm: no reply for 2 s"
