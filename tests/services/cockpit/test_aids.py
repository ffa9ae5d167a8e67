"""Figures that help to fly: how long the dive is, how long the battery lasts."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.sensors import BatterySample
from messages.vehicle import VehicleStatus
from services.cockpit.past import LEAST_NS, LONGEST_MIN, SPAN_NS, DiveTimer, Endurance

S = 1_000_000_000  # [ns]


def battery(at_s: float, used: float, capacity: float | None = 266.0) -> BatterySample:
    return BatterySample(
        stamp_ns=round(at_s * S), voltage=15.0, current=10.0, used_wh=used, capacity_wh=capacity
    )


@given(st.floats(20.0, 500.0), st.floats(0.0, 200.0), st.integers(40, 600))
def test_at_a_constant_power_the_battery_lasts_for_what_is_left(
    power: float, before: float, seconds: int
):
    endurance, capacity = Endurance(), 266.0
    for at in range(seconds):
        newest = battery(at, before + power * at / 3600.0, capacity)
        endurance.heard(newest)
        endurance.heard(newest)
        known = endurance.minutes(newest)
        if at * S < LEAST_NS:
            assert known is None
            continue
        assert newest.used_wh is not None
        minutes = 60.0 * max(0.0, capacity - newest.used_wh) / power
        if minutes < LONGEST_MIN - 1.0:
            assert known == pytest.approx(minutes, abs=0.51)


def test_of_another_battery_or_one_of_unknown_size_nothing_is_said_too_early():
    endurance = Endurance()
    for at in range(60):
        endurance.heard(battery(at, 0.1 * at))
    assert endurance.minutes(battery(59, 5.9)) is not None
    endurance.heard(battery(60, 0.0))
    assert endurance.minutes(battery(60, 0.0)) is None
    assert endurance.minutes(battery(60, 0.0, None)) is None
    assert endurance.minutes(None) is None


def test_the_use_of_long_ago_does_not_count():
    endurance, used, at = Endurance(), 0.0, 0
    for power in (300.0, 60.0):
        for _ in range(2 * SPAN_NS // S):
            used, at = used + power / 3600.0, at + 1
            endurance.heard(battery(at, used, 400.0))
    left = 400.0 - used  # [Wh], and as many minutes at 60 W
    assert endurance.minutes(battery(at, used, 400.0)) == pytest.approx(left, abs=1.0)


def test_the_dive_begins_when_the_drone_is_first_armed():
    timer = DiveTimer()
    for now, armed in ((0, False), (5, True), (7, False), (9, True)):
        timer.heard(VehicleStatus(stamp_ns=0, activity="ready", armed=armed), now * S)
    assert timer.seconds(65 * S) == 60
    assert DiveTimer().seconds(5 * S) is None
