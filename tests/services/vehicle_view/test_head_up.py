"""The head-up numbers: everything that a pilot must see, each always in its place."""

from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.vehicle import VehicleStatus
from services.vehicle_view import ages
from services.vehicle_view.head_up import NumbersRow, head_up
from services.vehicle_view.view import Newest, VehicleView, vehicle_view
from services.vehicle_view.words import notes

CALM = VehicleView(
    activity="piloted",
    doing="piloted",
    flight_mode="station_keeping",
    light=0.5,
    battery_v=15.94,
    used_wh=12.3,
    capacity_wh=266.0,
    charge=0.95,
    armed=True,
    age_ms=42.0,
    depth_m=12.345,
    depth_wanted_m=12.4,
    heading_deg=359.9,
    heading_wanted_deg=0.1,
    rtt_ms=23.4,
)
number = st.none() | st.floats(-1e4, 1e4)
words = st.text(max_size=300)
views = st.builds(
    VehicleView,
    activity=words, doing=words, flight_mode=words, light=number,
    battery_v=number, used_wh=number, capacity_wh=number,
    armed=st.booleans(), silent_s=number, failsafe=st.sampled_from(["none", "pilot_lost"]),
    since_s=number, next_s=number, words=words, note=words, age_ms=number, depth_m=number,
    depth_wanted_m=number, heading_deg=number, heading_wanted_deg=number, rtt_ms=number,
    alarm=words,
)  # fmt: skip


def places(rows: list[NumbersRow]) -> list[tuple[str, int]]:
    return [(row.size, len(row.cells)) for row in rows]


def said(view: VehicleView) -> str:
    cells = [cell for row in head_up(view) for cell in row.cells]
    return "\n".join(f"{cell.label}: {cell.text}" for cell in cells)


@given(views)
def test_whatever_is_known_every_number_stays_in_its_place(view: VehicleView):
    assert places(head_up(view)) == places(head_up(VehicleView()))


@given(views)
def test_a_failsafe_and_the_links_alarm_are_alarms_with_all_their_words(view: VehicleView):
    text = head_up(view)[-1].cells[0]
    assert (text.tone == "alarm") == bool(
        view.failsafe != "none" or view.next_s is not None or view.words or view.alarm
    )
    for part in (view.words, view.alarm, view.note):
        assert part in text.text


def test_old_numbers_and_the_last_known_state_are_warnings():
    view = replace(CALM, age_ms=2345.0, silent_s=4.0)
    rows = head_up(view)
    assert [cell.tone for cell in rows[1].cells] == ["warning", "warning"]
    assert rows[0].cells[0].label == "last known"
    assert "2.3 s old" in said(view)


@given(st.floats(0.0, 1e5))
def test_a_drone_that_is_not_heard_is_the_last_known_one(age_s: float):
    status = VehicleStatus(stamp_ns=0, activity="piloted", armed=True, light=1.0)
    view = vehicle_view(Newest(status=status), round(age_s * 1e9))
    assert view.armed
    silent = [note for note in notes(view) if note.startswith("no status from the drone")]
    assert view.last_known == bool(silent) == (round(age_s * 1e9) > ages.STATUS.grey_ns)
    assert (view.light is None) == view.last_known
