from math import cos, exp, hypot, pi, radians, sin

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from messages import events
from messages.units import Vec3
from services.estimation.attitude.attitude_filter import AttitudeSettings
from services.estimation.attitude.attitude_observer import HEADING_STD, AttitudeObserver
from services.estimation.attitude.heading import (
    COMPASS_GATE,
    COMPASS_TIME,
    PERIOD,
    RELEARN,
    UNKNOWN_TURN,
    YAW_RATE_CUTOFF,
    Compass,
    ControlHeading,
    bearing,
    down_along,
    horizontal,
    strength_and_dip,
    wrapped,
)
from services.marine.attitude import from_euler, to_body, to_world
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
    estimate = o.estimates(True, now).heading_navigation
    assert estimate is not None
    return estimate.value


def test_a_wrong_heading_comes_back_to_north_with_the_compass_time():
    o = observer(heading=0.15)  # within the gate: a gyroscope that has drifted, not iron
    o.agree(0, NORTH)
    for k in range(1, 1001):
        o.magnetometer(NORTH, k * S // 100)
    assert navigation(o, 10 * S) == pytest.approx(0.15 * exp(-10.0 / COMPASS_TIME), abs=0.002)
    assert o.estimates(True, 0).heading.value == 0.15


def test_after_calibration_both_headings_are_one():
    o = observer(heading=2.0)
    assert o.estimates(True, 0).heading_navigation is None
    o.agree(0, NORTH)
    assert navigation(o, 0) == 2.0


def test_without_a_magnetometer_for_a_minute_north_is_no_longer_valid():
    o = observer()
    o.agree(0, NORTH)
    early, late = (
        o.estimates(True, 59 * S).heading_navigation,
        o.estimates(True, 61 * S).heading_navigation,
    )
    assert early is not None
    assert late is not None
    assert early.valid
    assert not late.valid


def test_the_yaw_rate_is_the_gyroscopes_without_its_bias_through_a_low_pass():
    o = AttitudeObserver(SET, (0.0, 0.0, 0.1), 0.0, 0.0)
    seconds = 1.0 / (2 * pi * YAW_RATE_CUTOFF)  # one time constant in ten steps
    for _ in range(10):
        o.step((0.0, 0.0, 0.6), REST, seconds / 10)
    assert o.estimates(True, 0).yaw_rate.value == pytest.approx(0.5 * (1 - exp(-1.0)))


def test_spreads_grow_with_time_and_with_blindness():
    o = observer()
    for _ in range(6000):
        o.step((0.0, 0.0, 0.0), REST, 0.01)
    assert o.estimates(True, 0).heading.std == pytest.approx(HEADING_STD + radians(0.24), rel=0.05)
    o.blind(1.0)
    assert o.estimates(True, 0).heading.std == pytest.approx(UNKNOWN_TURN, rel=0.02)
    o.blind(1e6)
    assert o.estimates(True, 0).heading.std == pi


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


attitudes = st.tuples(angle, st.floats(-1.5, 1.5), angle)
dips = st.floats(-1.3, 1.3)
strengths = st.floats(25.0, 65.0)  # [µT]
bearings = st.floats(-3.1, 3.1)


def earth(strength: float, dip: float, north: float = 0.0) -> Vec3:
    """[T] NED, of a field [µT, rad] whose north is `north` [rad] to the right of yaw 0."""
    level = 1e-6 * strength * cos(dip)
    return level * cos(north), level * sin(north), 1e-6 * strength * sin(dip)


@given(attitudes, strengths, dips, bearings)
def test_a_field_has_its_strength_dip_and_bearing_however_the_vehicle_lies(
    euler: tuple[float, float, float], strength: float, dip: float, north: float
) -> None:
    q = from_euler(*euler)
    seen = to_body(q, earth(strength, dip, north))
    assert strength_and_dip(q, seen) == pytest.approx((strength, dip))
    assert bearing(q, seen) == pytest.approx(-north)


@given(attitudes, st.floats(1.0, 3.0), st.floats(0.0, 70.0), angle)
def test_a_field_of_less_than_two_microtesla_across_has_no_bearing(
    euler: tuple[float, float, float], level: float, down: float, north: float
) -> None:
    q, compass = from_euler(*euler), Compass(SET)
    compass.resume(0.3, 50.0, 1.0)
    seen = to_body(q, (1e-6 * level * cos(north), 1e-6 * level * sin(north), 1e-6 * down))
    is_steep = hypot(*horizontal(q, seen)) < 2e-6
    assert is_steep == (level < 2.0) or abs(level - 2.0) < 1e-9
    assert (bearing(q, seen) is None) == is_steep
    assert (compass.step(q, seen, 0.01) is events.STEEP) == is_steep
    if is_steep:
        assert (compass.offset, compass.std) == (0.3, SET.compass_std)


@given(attitudes, strengths, dips, bearings, st.floats(0.0, 0.6), st.floats(-1.0, 1.0))
def test_the_compass_is_trusted_up_to_its_gate_or_three_times_what_its_spread_has_grown(
    euler: tuple[float, float, float],
    strength: float,
    dip: float,
    offset: float,
    grown: float,
    share: float,
) -> None:
    """And then it comes back to north in the compass time, and its spread to that of a compass."""
    q, compass, dt = from_euler(*euler), Compass(SET), 0.5
    compass.resume(offset, strength, dip)
    compass.std = SET.compass_std + grown
    gate = max(radians(COMPASS_GATE), 3.0 * grown)
    innovation = share * 2.0 * gate if abs(share * 2.0 * gate) < 3.0 else 0.0
    compass.step(q, to_body(q, earth(strength, dip, -offset - innovation)), dt)
    if abs(abs(innovation) - gate) < 1e-6:
        return
    used = abs(innovation) < gate
    assert compass.field.trusted == used
    nearer = 1.0 - exp(-dt / COMPASS_TIME) if used else 0.0
    assert compass.offset is not None
    assert wrapped(compass.offset - offset) == pytest.approx(nearer * innovation, abs=1e-9)
    assert -pi < compass.offset <= pi
    assert compass.std - SET.compass_std == pytest.approx((1.0 - nearer) * grown)


@given(attitudes, strengths, dips, bearings, bearings)
def test_north_is_where_the_compass_first_shows_it_and_where_a_field_is_learnt_anew(
    euler: tuple[float, float, float], strength: float, dip: float, north: float, later: float
) -> None:
    q, compass = from_euler(*euler), Compass(SET)
    compass.field.learn(strength, dip)
    compass.step(q, to_body(q, earth(strength, dip, north)), 0.01)
    assert compass.offset == pytest.approx(-north)
    compass.std = 0.2
    assume(abs(wrapped(later - north)) > max(radians(COMPASS_GATE), 3.0 * 0.2))
    seen = to_body(q, earth(strength, dip, later))
    told = [compass.step(q, seen, RELEARN / 4) for _ in range(5)]
    assert told == [events.DISTURBED, None, None, None, events.LEARNT]
    assert compass.field.trusted
    assert compass.offset == pytest.approx(-later)
    assert compass.std == SET.compass_std


@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)), max_size=8))
def test_a_control_heading_adds_up_the_turns_and_follows_the_rate_through_its_low_pass(
    turns: list[tuple[float, float]],
) -> None:
    heading, dt = ControlHeading(SET, 3.0, 0.0), 0.02
    yaw, rate = 3.0, 0.0
    for turn, measured in turns:
        yaw += turn
        heading.step(wrapped(yaw), measured, dt)
        keep = exp(-2 * pi * YAW_RATE_CUTOFF * dt)
        rate = keep * rate + (1.0 - keep) * measured
        assert heading.heading == pytest.approx(yaw)
        assert heading.yaw_rate == pytest.approx(rate, abs=1e-12)


def test_nose_straight_up_has_no_valid_heading():
    o = observer()
    o.start((GRAVITY, 0.0, 0.0))
    assert not o.estimates(True, 0).heading.valid
    assert o.estimates(True, 0).pitch.value == pytest.approx(pi / 2)
