"""The head-up numbers: everything that a pilot must see, each always in its place."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from messages.vehicle import VehicleStatus
from services.piloting.head_up import NumbersRow, head_up
from services.piloting.pilot_view import PilotView, pilot_view

CALM = PilotView(
    mode="piloted",
    hold="station_keeping",
    light=0.5,
    battery_v=15.94,
    used_wh=12.3,
    capacity_wh=266.0,
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
    PilotView,
    mode=words, hold=words, light=number, battery_v=number, used_wh=number, capacity_wh=number,
    armed=st.booleans(), last_known=st.booleans(), failsafe=st.sampled_from(["none", "pilot_lost"]),
    since_s=number, next_s=number, words=words, note=words, age_ms=number, depth_m=number,
    depth_wanted_m=number, heading_deg=number, heading_wanted_deg=number, rtt_ms=number,
    alarm=words,
)  # fmt: skip


def places(rows: list[NumbersRow]) -> list[tuple[str, int]]:
    return [(row.size, len(row.cells)) for row in rows]


def said(view: PilotView) -> str:
    cells = [cell for row in head_up(view) for cell in row.cells]
    return "\n".join(f"{cell.label}: {cell.text}" for cell in cells)


@given(views)
def test_whatever_is_known_every_number_stays_in_its_place(view: PilotView):
    assert places(head_up(view)) == places(head_up(PilotView()))


def test_all_is_shown():
    text = said(CALM)
    for part in (
        "ARMED", "hold: station keeping: piloted", "depth [m]: 12.35", "reference 12.40",
        "heading [°]: 359.9", "reference 0.1", "battery: 15.9 V, 12.3 Wh used of 266",
        "light: 50 %", "link, round trip: 23 ms", "age of depth and heading: 42 ms",
    ):  # fmt: skip
        assert part in text
    assert all(
        cell.tone in ("plain", "good", "warning") for row in head_up(CALM) for cell in row[0]
    )


@given(views)
def test_a_failsafe_and_the_links_alarm_are_alarms_with_all_their_words(view: PilotView):
    text = head_up(view)[-1].cells[0]
    assert (text.tone == "alarm") == bool(
        view.failsafe != "none" or view.next_s is not None or view.words or view.alarm
    )
    for part in (view.words, view.alarm, view.note):
        assert part in text.text


def test_old_numbers_and_the_last_known_state_are_warnings():
    view = replace(CALM, age_ms=2345.0, last_known=True)
    rows = head_up(view)
    assert [cell.tone for cell in rows[1].cells] == ["warning", "warning"]
    assert rows[0].cells[0].label == "last known"
    assert "2.3 s old" in said(view)


def test_what_is_not_known_is_a_dash():
    assert "depth [m]: –" in said(PilotView())
    assert "0.0" not in said(PilotView())


@given(st.floats(0.0, 1e5))
def test_a_drone_that_is_not_heard_is_the_last_known_one(age_s: float):
    status = VehicleStatus(stamp_ns=0, mode="piloted", armed=True, light=1.0)
    view = pilot_view(
        round(age_s * 1e9), status=status, state=None, reference=None, battery=None, link=None,
        clock=None, budget=None,
    )  # fmt: skip
    assert view.armed
    assert view.last_known == bool(view.note) == (round(age_s * 1e9) > 1_500_000_000)
    assert (view.light is None) == view.last_known
