from math import acos, cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Quaternion, Vec3
from services.estimation.attitude.attitude_filter import (
    AttitudeFilter,
    AttitudeSettings,
    corrected,
    tilt_of,
    turned,
    unit,
)
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.attitude.heading import bearing, wrapped
from services.marine.attitude import down_in_body, from_euler, to_euler
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
    found = AttitudeFilter(AttitudeSettings(correction=0.5))
    found.q = start
    force = resting_force(truth)
    for _ in range(1500):
        assert found.step((0.0, 0.0, 0.0), force, 0.02)
    # The exact opposite of down is a saddle: from there any direction is as good as any other.
    if tilt_error(start, truth) < 3.0:
        assert tilt_error(found.q, truth) < 1e-3


@given(angles, steep, angles, angles, steep)
def test_the_correction_descends_the_tilt_error_and_never_turns_about_the_vertical(
    roll: float, pitch: float, yaw: float, other_roll: float, other_pitch: float
):
    q, truth = from_euler(roll, pitch, yaw), from_euler(other_roll, other_pitch, yaw)
    error = tilt_error(q, truth)
    if not 0.01 < error < 3.0:
        return
    after = corrected(q, down_in_body(truth), 1e-3)
    assert tilt_error(after, truth) < error
    # The turn as seen from the world: its vertical part is z of after ⊗ q*.
    w, x, y, z = q
    aw, ax, ay, az = after
    assert abs(-aw * z + az * w + -ax * y + ay * x) < 1e-5 + abs(aw * w - 1.0)


@given(angles, steep, angles, angles, steep)
def test_the_correction_is_along_the_gradient_of_madgwicks_objective(
    roll: float, pitch: float, yaw: float, other_roll: float, other_pitch: float
):
    q, down = (
        from_euler(roll, pitch, yaw),
        down_in_body(from_euler(other_roll, other_pitch, 0)),
    )

    def objective(at: np.ndarray) -> float:
        w, x, y, z = at.tolist()
        return float(np.sum((np.array(down_in_body((w, x, y, z))) - np.array(down)) ** 2)) / 2

    start, h = np.array(q), 1e-5
    slope = np.array([(objective(start + e) - objective(start - e)) / 2 / h for e in h * np.eye(4)])
    if np.linalg.norm(slope) < 0.05:
        return
    w, x, y, z = (start - 0.01 * slope / np.linalg.norm(slope)).tolist()
    assert corrected(q, down, 0.01) == pytest.approx(unit(w, x, y, z), abs=1e-7)


@given(st.lists(st.tuples(rates, rates, rates), min_size=1, max_size=200))
def test_the_quaternion_keeps_its_length(turns: list[Vec3]):
    found = AttitudeFilter(AttitudeSettings())
    for turn in turns:
        found.step(turn, REST, 0.01)
        assert hypot(*found.q) == pytest.approx(1.0, abs=1e-12)


def test_an_accelerating_vehicle_is_not_leaned_over():
    found = AttitudeFilter(AttitudeSettings())
    for _ in range(200):
        assert not found.step((0.0, 0.0, 0.0), (5.0, 0.0, -GRAVITY), 0.01)
    assert found.q == (1.0, 0.0, 0.0, 0.0)


@settings(max_examples=50, deadline=None)
@given(st.floats(-2.0, 2.0), angles, st.integers(100, 800))
def test_heading_accumulates_the_turns_and_agrees_with_yaw(rate: float, start: float, steps: int):
    observer = AttitudeObserver(AttitudeSettings(), (0.0, 0.0, 0.0), start, 0.0)
    for _ in range(steps):
        observer.step((0.0, 0.0, rate), REST, 0.01)
    heading = observer.control.heading
    assert heading == pytest.approx(start + rate * steps * 0.01, abs=1e-3 + 2e-4 * abs(rate) * 8)
    assert wrapped(heading - to_euler(observer.attitude)[2]) == pytest.approx(0.0, abs=1e-9)


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
