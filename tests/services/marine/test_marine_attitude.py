"""Quaternions turn as rotations must."""

from math import cos, isclose, pi, radians, sin, sqrt

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.message import Estimate
from messages.state import VehicleState
from services.marine.attitude import (
    attitude_rate,
    down_in_body,
    from_euler,
    level_velocity,
    normalised,
    tilt,
    to_body,
    to_euler,
    to_world,
    wrapped,
)

angle = st.floats(-pi, pi)
pitch = st.floats(-1.5, 1.5)
number = st.floats(-10, 10)
vector = st.tuples(number, number, number)
attitude = st.builds(from_euler, angle, pitch, angle)
law = settings(max_examples=80, deadline=None)


@law
@given(angle, pitch, angle)
def test_euler_angles_survive_the_way_through_a_quaternion(r: float, p: float, h: float) -> None:
    for back, angle_in in zip(to_euler(from_euler(r, p, h)), (r, p, h), strict=True):
        assert wrapped(back - angle_in) == pytest.approx(0.0, abs=1e-6)


@law
@given(angle, pitch, angle, vector)
def test_turning_agrees_with_the_three_elementary_rotations(
    r: float, p: float, h: float, v: tuple[float, float, float]
) -> None:
    about_x = np.array([[1, 0, 0], [0, cos(r), -sin(r)], [0, sin(r), cos(r)]])
    about_y = np.array([[cos(p), 0, sin(p)], [0, 1, 0], [-sin(p), 0, cos(p)]])
    about_z = np.array([[cos(h), -sin(h), 0], [sin(h), cos(h), 0], [0, 0, 1]])
    R_NB = about_z @ about_y @ about_x
    assert to_world(from_euler(r, p, h), v) == pytest.approx(R_NB @ v, abs=1e-9)
    assert down_in_body(from_euler(r, p, h)) == pytest.approx(R_NB[2], abs=1e-9)


@law
@given(attitude, vector)
def test_to_body_undoes_to_world(
    q: tuple[float, float, float, float], v: tuple[float, float, float]
) -> None:
    assert to_body(q, to_world(q, v)) == pytest.approx(v, abs=1e-9)


@law
@given(attitude, vector)
def test_attitude_rate_keeps_the_length_and_moves_vectors_by_omega_cross_v(
    q: tuple[float, float, float, float], rate: tuple[float, float, float]
) -> None:
    dq = attitude_rate(q, rate)
    assert sum(a * b for a, b in zip(q, dq, strict=True)) == pytest.approx(0.0, abs=1e-12)
    step, v = 1e-6, (1.0, -2.0, 0.5)
    ahead = normalised(tuple(a + step * b for a, b in zip(q, dq, strict=True)))  # type: ignore[arg-type]
    moved = (np.array(to_world(ahead, v)) - np.array(to_world(q, v))) / step
    assert moved == pytest.approx(np.array(to_world(q, tuple(np.cross(rate, v)))), abs=1e-3)


def test_signs_are_right_wing_down_nose_up_and_clockwise() -> None:
    ten = radians(10)
    right_wing = to_world(from_euler(ten, 0, 0), (0.0, 1.0, 0.0))
    nose_up = to_world(from_euler(0, ten, 0), (1.0, 0.0, 0.0))
    clockwise = to_world(from_euler(0, 0, ten), (1.0, 0.0, 0.0))
    assert right_wing[2] > 0
    assert nose_up[2] < 0
    assert clockwise[1] > 0


def test_tilt_is_the_angle_from_upright_and_wrapped_stays_within_pi() -> None:
    assert tilt(from_euler(0.3, 0.0, 2.0)) == pytest.approx(0.3)
    assert tilt(from_euler(pi, 0.0, 0.0)) == pytest.approx(pi)
    assert wrapped(3 * pi / 2) == pytest.approx(-pi / 2)
    assert isclose(sqrt(sum(x * x for x in normalised((2.0, 1.0, -3.0, 0.1)))), 1.0)


@law
@given(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), angle, st.tuples(number, number, number))
def test_the_level_velocity_is_that_of_the_body_turned_by_its_whole_attitude(
    roll: float, pitch: float, heading: float, v_N: tuple[float, float, float]
) -> None:
    """Whatever the tilt: a vehicle that dives nose down without any horizontal motion has none."""
    attitude = from_euler(roll, pitch, heading)
    surge, sway, _ = to_body(attitude, v_N)
    found = level_velocity(example_state(attitude, surge, sway, v_N[2]))
    if found is None:
        assert tilt(attitude) > pi / 3 - 1e-9
        return
    ahead, starboard, _ = to_body(from_euler(0.0, 0.0, heading), v_N)
    assert found == pytest.approx((ahead, starboard), abs=1e-9)


def test_a_level_velocity_is_known_where_surge_and_sway_are() -> None:
    state = example_state(from_euler(0.0, 0.0, 0.3), 0.5, 0.1, 0.0)
    assert level_velocity(state) == pytest.approx((0.5, 0.1))
    assert level_velocity(msgspec.structs.replace(state, sway_velocity=None)) is None
    unknown = Estimate(0.5, 0.1, valid=False)
    assert level_velocity(msgspec.structs.replace(state, surge_velocity=unknown)) is None
    assert level_velocity(example_state(from_euler(0.0, 1.2, 0.3), 0.5, 0.1, 0.0)) is None


def example_state(
    attitude: tuple[float, float, float, float], surge: float, sway: float, depth_rate: float
) -> VehicleState:
    roll, pitch_, heading = (Estimate(each, 0.01) for each in to_euler(attitude))
    none = Estimate(0.0, 0.01)
    return VehicleState(
        stamp_ns=0, sensor_ns=0, phase="running", depth=none,
        depth_rate=Estimate(depth_rate, 0.01), depth_acceleration=none, attitude=attitude,
        roll=roll, pitch=pitch_, heading=heading, heading_navigation=None, yaw_rate=none,
        surge_velocity=Estimate(surge, 0.01), sway_velocity=Estimate(sway, 0.01),
    )  # fmt: skip
