from math import exp, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.units import Vec3
from services.estimation.attitude.attitude_filter import AttitudeSettings
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.attitude.heading import (
    PERIOD,
    UNKNOWN_TURN,
    Compass,
    ControlHeading,
    down_along,
    horizontal,
    wrapped,
)
from services.marine.attitude import from_euler, to_world
from services.marine.vehicle import GRAVITY

REST: Vec3 = (0.0, 0.0, -GRAVITY)
NORTH: Vec3 = (15e-6, 0.0, 48e-6)  # [T] seen by a vehicle that looks north
SET = AttitudeSettings()
S = 1_000_000_000  # [ns]


def observer(heading: float = 0.0) -> AttitudeObserver:
    made = AttitudeObserver(SET, (0.0, 0.0, 0.0), heading, 0.0)
    made.start(REST)
    return made


def navigation(o: AttitudeObserver, now: int) -> float:
    estimate = o.heading_navigation(True, now)
    assert estimate is not None
    return estimate.value


def test_a_wrong_heading_comes_back_to_north_with_the_compass_time():
    o = observer(heading=0.15)  # within the gate: a gyroscope that has drifted, not iron
    o.agree(0, NORTH)
    for k in range(1, 1001):
        o.magnetometer(NORTH, k * S // 100)
    assert navigation(o, 10 * S) == pytest.approx(0.15 * exp(-10.0 / SET.compass_time), abs=0.002)
    assert o.heading(True).value == 0.15


def test_after_calibration_both_headings_are_one():
    o = observer(heading=2.0)
    assert o.heading_navigation(True, 0) is None
    o.agree(0, NORTH)
    assert navigation(o, 0) == 2.0


def test_without_a_magnetometer_for_a_minute_north_is_no_longer_valid():
    o = observer()
    o.agree(0, NORTH)
    early, late = o.heading_navigation(True, 59 * S), o.heading_navigation(True, 61 * S)
    assert early is not None
    assert late is not None
    assert early.valid
    assert not late.valid


def test_the_yaw_rate_is_the_gyroscopes_without_its_bias_through_a_low_pass():
    o = AttitudeObserver(SET, (0.0, 0.0, 0.1), 0.0, 0.0)
    seconds = 1.0 / (2 * pi * SET.yaw_rate_cutoff)  # one time constant in ten steps
    for _ in range(10):
        o.step((0.0, 0.0, 0.6), REST, seconds / 10)
    assert o.yaw_rate(True).value == pytest.approx(0.5 * (1 - exp(-1.0)))


def test_spreads_grow_with_time_and_with_blindness():
    o = observer()
    for _ in range(6000):
        o.step((0.0, 0.0, 0.0), REST, 0.01)
    assert o.heading(True).std == pytest.approx(SET.heading_std + radians(0.24), rel=0.05)
    o.blind(1.0)
    assert o.heading(True).std == pytest.approx(UNKNOWN_TURN, rel=0.02)
    o.blind(1e6)
    assert o.heading(True).std == pi


components = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
angle = st.floats(-3.0, 3.0)


@given(angle, st.floats(-1.5, 1.5), angle, components)
def test_a_field_is_split_as_the_attitude_turns_it(
    roll: float, pitch: float, yaw: float, field: Vec3
):
    q = from_euler(roll, pitch, yaw)
    assert (*horizontal(q, field), down_along(q, field)) == pytest.approx(to_world(q, field))


@given(st.floats(0.1, 20.0))
def test_heard_half_as_often_a_heading_drifts_twice_as_fast(periods: float):
    """Both headings, in each second of time; heard more often than due it drifts no slower."""
    dt = periods * PERIOD
    control, compass = ControlHeading(SET, 0.0, 0.0), Compass(SET)
    before = compass.std
    control.step(0.0, 0.0, dt)
    compass.drift(dt)
    expected = SET.heading_drift * dt * max(1.0, periods)
    assert control.std == pytest.approx(expected)
    assert compass.std - before == pytest.approx(expected)


@given(st.floats(0.0, 20.0))
def test_blind_nothing_is_known_but_how_fast_it_may_have_turned(seconds: float):
    control, compass = ControlHeading(SET, 0.0, 0.1), Compass(SET)
    for heading in (control, compass):
        before = heading.std
        heading.blind(seconds)
        assert heading.std == pytest.approx(min(pi, before + UNKNOWN_TURN * seconds))


@given(st.floats(-10.0, 10.0))
def test_after_a_restart_north_is_where_it_was(offset: float):
    compass = Compass(SET)
    compass.resume(offset, 50.0, 1.0)
    assert compass.offset == pytest.approx(wrapped(offset))


def test_nose_straight_up_has_no_valid_heading():
    o = observer()
    o.start((GRAVITY, 0.0, 0.0))
    assert not o.heading(True).valid
    assert o.tilt(True)[1].value == pytest.approx(pi / 2)
