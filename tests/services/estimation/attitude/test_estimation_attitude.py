from math import acos, cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Quaternion, Vec3
from services.estimation.attitude.attitude_filter import (
    AttitudeFilter,
    AttitudeSettings,
    tilt_of,
    turned,
    unit,
)
from services.estimation.attitude.attitude_observer import AttitudeObserver, ImuNoise
from services.estimation.attitude.heading import bearing, wrapped
from services.estimation.attitude.tilt_spread import TiltSpread
from services.marine.attitude import LEVEL, down_in_body, from_euler, to_euler
from services.marine.vehicle import GRAVITY

angles = st.floats(-pi, pi)
steep = st.floats(-1.5, 1.5)
rates = st.floats(-3.0, 3.0)
REST: Vec3 = (0.0, 0.0, -GRAVITY)


def rotation(q: Quaternion) -> np.ndarray:
    """R_NB from the definition q v q*, one column per body axis."""
    w, x, y, z = q
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    v = np.array([x, y, z])
    return (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * cross


def resting_force(q: Quaternion) -> Vec3:
    """What an accelerometer measures at rest with this attitude."""
    x, y, z = (rotation(q).T @ np.array(REST)).tolist()
    return x, y, z


def tilt_error(q: Quaternion, other: Quaternion) -> float:
    dot = sum(a * b for a, b in zip(down_in_body(q), down_in_body(other), strict=True))
    return acos(max(-1.0, min(1.0, dot)))


@given(angles, steep, angles)
def test_euler_angles_come_back_from_their_quaternion(roll: float, pitch: float, yaw: float):
    back = to_euler(from_euler(roll, pitch, yaw))
    for angle, expected in zip(back, (roll, pitch, yaw), strict=True):
        assert wrapped(angle - expected) == pytest.approx(0.0, abs=1e-7)


@given(angles, steep, angles, st.tuples(rates, rates, rates))
def test_a_turn_is_about_the_axes_of_the_body(roll: float, pitch: float, yaw: float, rate: Vec3):
    """The body's axes move with ω × axis, ω in the body (dR/dt = R [ω]×)."""
    q, dt = from_euler(roll, pitch, yaw), 1e-5
    p, r, s = rate
    cross = np.array([[0, -s, r], [s, 0, -p], [-r, p, 0]])
    change = (rotation(turned(q, rate, dt)) - rotation(q)) / dt
    assert change == pytest.approx(rotation(q) @ cross, abs=1e-3)


@given(angles, steep, angles)
def test_the_rotation_is_yaw_then_pitch_then_roll(roll: float, pitch: float, yaw: float):
    cr, sr, cp, sp, cy, sy = cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw)
    z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    assert rotation(from_euler(roll, pitch, yaw)) == pytest.approx(z @ y @ x, abs=1e-12)


@given(angles, steep, angles)
def test_tilt_is_read_off_the_accelerometer_at_rest(roll: float, pitch: float, yaw: float):
    seen = tilt_of(resting_force(from_euler(roll, pitch, yaw)))
    assert wrapped(seen[0] - roll) == pytest.approx(0.0, abs=1e-6)
    assert seen[1] == pytest.approx(pitch, abs=1e-6)


def test_ten_degrees_about_the_forward_axis_is_roll():
    q = turned((1.0, 0.0, 0.0, 0.0), (pi / 18, 0.0, 0.0), 1.0)
    roll, pitch, yaw = to_euler(q)
    assert roll == pytest.approx(pi / 18, rel=0.01)
    assert (pitch, yaw) == (0.0, 0.0)


@settings(max_examples=40, deadline=None)
@given(st.floats(-2.9, 2.9), steep, angles, st.floats(-2.9, 2.9), steep)
def test_at_rest_the_filter_finds_the_tilt_from_any_start_and_keeps_its_heading_still(
    roll: float, pitch: float, yaw: float, first_roll: float, first_pitch: float
):
    truth = from_euler(roll, pitch, yaw)
    start = from_euler(first_roll, first_pitch, yaw)
    found = AttitudeFilter()
    found.q = start
    force = resting_force(truth)
    for _ in range(300):
        found.step((0.0, 0.0, 0.0), force, 0.02, 0.05, pi)
    # The exact opposite of down is a saddle: from there any direction is as good as any other.
    if tilt_error(start, truth) < 3.0:
        assert tilt_error(found.q, truth) < 1e-3


@given(angles, steep, angles, angles, steep, st.floats(0.01, 0.05), st.floats(0.01, pi))
def test_the_correction_is_its_share_of_the_tilt_error_and_never_turns_about_the_vertical(
    roll: float, pitch: float, yaw: float, other_roll: float, other_pitch: float,
    share: float, most: float,
):  # fmt: skip
    q, truth = from_euler(roll, pitch, yaw), from_euler(other_roll, other_pitch, yaw)
    error = tilt_error(q, truth)
    if not 0.01 < error < 3.0:
        return
    found = AttitudeFilter()
    found.q = q
    found.step((0.0, 0.0, 0.0), resting_force(truth), 0.01, share, most)
    step = share * min(error, most)
    assert tilt_error(found.q, truth) == pytest.approx(error - step, rel=1e-3)
    # The turn as seen from the world: its vertical part is z of after ⊗ q*.
    w, x, y, z = q
    aw, ax, ay, az = found.q
    assert -aw * z + az * w - ax * y + ay * x == pytest.approx(0.0, abs=1e-9)
    assert hypot(*found.levelled) == pytest.approx(step, rel=0.01)


@given(st.lists(st.tuples(rates, rates, rates), min_size=1, max_size=200))
def test_the_quaternion_keeps_its_length(turns: list[Vec3]):
    found = AttitudeFilter()
    for turn in turns:
        found.step(turn, REST, 0.01, 0.01, 0.1)
        assert hypot(*found.q) == pytest.approx(1.0, abs=1e-12)


def observer() -> AttitudeObserver:
    """Calibrated, level and at rest."""
    found = AttitudeObserver(AttitudeSettings(), (0.0, 0.0, 0.0), 0.0, 0.0)
    found.start(REST)
    return found


def accelerated(found: AttitudeObserver, by: float, seconds: float) -> float:
    """[rad] by which an acceleration forward [m/s²] leans it over."""
    for _ in range(round(100 * seconds)):
        found.step((0.0, 0.0, 0.0), (by, 0.0, -GRAVITY), 0.01)
    return tilt_error(found.filter.q, LEVEL)


@settings(max_examples=20)
@given(st.floats(-1.2, 1.2))
def test_an_acceleration_of_two_seconds_hardly_leans_a_calibrated_vehicle_over(by: float):
    assert accelerated(observer(), by, 2.0) < 1e-3


@settings(max_examples=20)
@given(st.floats(0.1, 3.0), st.floats(0.1, 3.0))
def test_what_the_thrust_makes_expect_leans_it_over_less(by: float, share: float):
    """With what is expected of it taken away; an expectation that is twice the truth is no worse
    than none."""
    told, untold = observer(), observer()
    for _ in range(300):
        told.step((0.0, 0.0, 0.0), (by, 0.0, -GRAVITY), 0.01, felt=(min(share, 2.0) * by, 0.0))
    assert tilt_error(told.filter.q, LEVEL) <= accelerated(untold, by, 3.0) + 1e-9


def test_vibration_costs_certainty_and_not_the_attitude():
    """3 m/s² and 0.1 rad/s of one sample, for a minute."""
    found, rng = observer(), np.random.default_rng(3)
    noise = ImuNoise(9.0, 0.01)
    before = found.tilt_std
    for _ in range(6000):
        p, q, r = (0.1 * rng.standard_normal(3)).tolist()
        x, y, z = (3.0 * rng.standard_normal(3)).tolist()
        found.step((p, q, r), (x, y, z - GRAVITY), 0.01, noise)
    assert tilt_error(found.filter.q, LEVEL) < 3.0 * found.tilt_std < 0.3
    assert found.tilt_std > before
    assert not found.gyroscope.learning


@settings(max_examples=20, deadline=None)
@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_a_gyroscope_that_never_rested_shows_its_bias_against_gravity(p: float, q: float):
    found = AttitudeObserver(AttitudeSettings(), (0.0, 0.0, 0.0), 0.0, 0.0)
    found.begin_roughly(REST)
    for _ in range(1500):
        found.step((p, q, 0.0), REST, 0.01)
    assert found.gyro_bias[:2] == pytest.approx((p, q), abs=5e-3)
    assert tilt_error(found.filter.q, LEVEL) < 3.0 * found.tilt_std


@settings(max_examples=50, deadline=None)
@given(st.floats(0.0, 0.5), st.floats(0.0, 1.0), st.lists(st.floats(1e-6, 1.0), min_size=1))
def test_the_spread_of_tilt_and_bias_stays_one_of_a_covariance(
    tilt: float, bias: float, variances: list[float]
):
    spread = TiltSpread(tilt, bias)
    for variance in variances:
        spread.predict(0.01, 0.5, 1e-4, 0.0, False)
        share, _ = spread.correct(variance)
        assert 0.0 <= share <= 1.0
        assert spread.tilt >= 0.0
        assert spread.bias >= 0.0
        assert spread.both**2 <= spread.tilt * spread.bias * (1.0 + 1e-9) + 1e-15


@settings(max_examples=50, deadline=None)
@given(st.floats(-2.0, 2.0), angles, st.integers(100, 800))
def test_heading_accumulates_the_turns_and_agrees_with_yaw(rate: float, start: float, steps: int):
    observer = AttitudeObserver(AttitudeSettings(), (0.0, 0.0, 0.0), start, 0.0)
    for _ in range(steps):
        observer.step((0.0, 0.0, rate), REST, 0.01)
    heading = observer.control.heading
    assert heading == pytest.approx(start + rate * steps * 0.01, abs=1e-3 + 2e-4 * abs(rate) * 8)
    assert wrapped(heading - to_euler(observer.filter.q)[2]) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(rates, rates, rates), min_size=1, max_size=100), st.integers(-5, 5))
def test_whole_turns_of_the_start_pass_through_unchanged(turns: list[Vec3], whole: int):
    near = AttitudeObserver(AttitudeSettings(), (0.0, 0.0, 0.0), 1.0, 0.0)
    far = AttitudeObserver(AttitudeSettings(), (0.0, 0.0, 0.0), 1.0 + 2 * pi * whole, 0.0)
    for turn in turns:
        near.step(turn, REST, 0.01)
        far.step(turn, REST, 0.01)
    turned_by = far.control.heading - near.control.heading
    assert turned_by == pytest.approx(2 * pi * whole, abs=1e-6)


@given(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), angles)
def test_the_compass_sees_north_through_any_tilt(roll: float, pitch: float, heading: float):
    q = from_euler(roll, pitch, heading)
    x, y, z = (rotation(q).T @ np.array([15e-6, 0.0, 48e-6])).tolist()
    seen = bearing(from_euler(roll, pitch, 0.0), (x, y, z))
    assert seen is not None
    assert wrapped(seen - heading) == pytest.approx(0.0, abs=1e-9)


def test_a_vertical_field_gives_no_heading():
    assert bearing((1.0, 0.0, 0.0, 0.0), (1e-7, 0.0, 50e-6)) is None


def test_unit_makes_any_quaternion_a_rotation():
    assert hypot(*unit(3.0, -1.0, 2.0, 0.5)) == pytest.approx(1.0)
