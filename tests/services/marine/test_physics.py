"""Attitude, rigid body, forces of the water, and the water itself."""

from collections.abc import Callable
from math import cos, isclose, pi, sin, sqrt
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.message import Estimate
from messages.state import VehicleState
from messages.units import Quaternion, Vec3, Vec6
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
from services.marine.hydrodynamics import (
    coriolis,
    damping,
    full_buoyancy,
    submerged_share,
    system_inertia,
    wake_fins,
    wake_lift,
)
from services.marine.vehicle import GRAVITY, SEA_WATER, Vehicle
from services.marine.water import Density, density, density_of
from services.runtime.config.stack import Stack
from tests.support.said import state
from tests.support.textbook_vessel import kinetic_energy, restoring

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
    r: float, p: float, h: float, v: Vec3
) -> None:
    about_x = np.array([[1, 0, 0], [0, cos(r), -sin(r)], [0, sin(r), cos(r)]])
    about_y = np.array([[cos(p), 0, sin(p)], [0, 1, 0], [-sin(p), 0, cos(p)]])
    about_z = np.array([[cos(h), -sin(h), 0], [sin(h), cos(h), 0], [0, 0, 1]])
    R_NB = about_z @ about_y @ about_x
    assert to_world(from_euler(r, p, h), v) == pytest.approx(R_NB @ v, abs=1e-9)
    assert to_body(from_euler(r, p, h), v) == pytest.approx(R_NB.T @ v, abs=1e-9)
    assert down_in_body(from_euler(r, p, h)) == pytest.approx(R_NB[2], abs=1e-9)


@law
@given(attitude, vector)
def test_attitude_rate_keeps_the_length_and_moves_vectors_by_omega_cross_v(
    q: Quaternion, rate: Vec3
) -> None:
    dq = attitude_rate(q, rate)
    assert sum(a * b for a, b in zip(q, dq, strict=True)) == pytest.approx(0.0, abs=1e-12)
    step, v = 1e-6, (1.0, -2.0, 0.5)
    ahead = normalised(tuple(a + step * b for a, b in zip(q, dq, strict=True)))  # type: ignore[arg-type]
    moved = (np.array(to_world(ahead, v)) - np.array(to_world(q, v))) / step
    assert moved == pytest.approx(np.array(to_world(q, tuple(np.cross(rate, v)))), abs=1e-3)


def test_tilt_is_the_angle_from_upright_and_wrapped_stays_within_pi() -> None:
    assert tilt(from_euler(0.3, 0.0, 2.0)) == pytest.approx(0.3)
    assert tilt(from_euler(pi, 0.0, 0.0)) == pytest.approx(pi)
    assert wrapped(3 * pi / 2) == pytest.approx(-pi / 2)
    assert isclose(sqrt(sum(x * x for x in normalised((2.0, 1.0, -3.0, 0.1)))), 1.0)


@law
@given(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), angle, st.tuples(number, number, number))
def test_the_level_velocity_is_that_of_the_body_turned_by_its_whole_attitude(
    roll: float, pitch: float, heading: float, v_N: Vec3
) -> None:
    """Whatever the tilt: a vehicle that dives nose down without any horizontal motion has none."""
    attitude = from_euler(roll, pitch, heading)
    surge, sway, _ = to_body(attitude, v_N)
    found = level_velocity(lying(attitude, surge, sway, v_N[2]))
    if found is None:
        assert tilt(attitude) > pi / 3 - 1e-9
        return
    ahead, starboard, _ = to_body(from_euler(0.0, 0.0, heading), v_N)
    assert found == pytest.approx((ahead, starboard), abs=1e-9)


def test_a_level_velocity_is_known_where_surge_and_sway_are() -> None:
    seen = lying(from_euler(0.0, 0.0, 0.3), 0.5, 0.1, 0.0)
    assert level_velocity(seen) == pytest.approx((0.5, 0.1))
    assert level_velocity(msgspec.structs.replace(seen, sway_velocity=None)) is None
    unknown = Estimate(0.5, 0.1, valid=False)
    assert level_velocity(msgspec.structs.replace(seen, surge_velocity=unknown)) is None
    assert level_velocity(lying(from_euler(0.0, 1.2, 0.3), 0.5, 0.1, 0.0)) is None


def lying(attitude: Quaternion, surge: float, sway: float, depth_rate: float) -> VehicleState:
    roll, pitch, heading = to_euler(attitude)
    return state(
        attitude=attitude, roll=roll, pitch=pitch, heading=heading, depth_rate=depth_rate,
        surge_velocity=surge, sway_velocity=sway,
    )  # fmt: skip


PIONEER = Stack().section("vehicle", Vehicle)
motion = st.tuples(*[st.floats(-3, 3)] * 6)
inertia = st.tuples(*[st.floats(0.1, 500)] * 6)


def cross_matrix(v: np.ndarray) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@law
@given(inertia, motion)
def test_coriolis_is_fossens_matrix(M: Vec6, nu: Vec6) -> None:
    linear, angular = cross_matrix(np.multiply(M[:3], nu[:3])), np.multiply(M[3:], nu[3:])
    C = np.block([[np.zeros((3, 3)), -linear], [-linear, -cross_matrix(angular)]])
    assert coriolis(M, nu) == pytest.approx(C @ nu, abs=1e-6)


def test_inertia_is_the_body_and_the_water_it_moves() -> None:
    M = system_inertia(PIONEER)
    assert M[0] == pytest.approx(8.6 + 5.22)
    assert M[5] == pytest.approx(0.216 + 0.159)
    assert kinetic_energy(M, (2.0, 0, 0, 0, 0, 0)) == pytest.approx(2 * M[0])


axis = st.integers(0, 2)


def power(wrench: Vec6 | list[float], nu: Vec6) -> float:
    return sum(f * n for f, n in zip(wrench, nu, strict=True))


@law
@given(motion)
def test_drag_only_takes_energy(nu: Vec6) -> None:
    drag = damping(PIONEER.linear_damping, PIONEER.quadratic_damping, nu)
    assert power(drag, nu) >= 0
    opposite: Vec6 = tuple(-n for n in nu)  # type: ignore[assignment]
    back = damping(PIONEER.linear_damping, PIONEER.quadratic_damping, opposite)
    assert drag == pytest.approx([-d for d in back])


@law
@given(motion, st.floats(0, 1))
def test_the_wake_only_takes_energy(nu: Vec6, share: float) -> None:
    assert power(wake_lift(wake_fins(PIONEER, share), nu), nu) <= 1e-12


@law
@given(axis, axis, st.floats(-2, 2), st.floats(-2, 2), st.floats(0, 1))
def test_the_wake_takes_back_its_share_of_the_munk_moment(
    i: int, j: int, along: float, across: float, share: float
) -> None:
    nu = [0.0] * 6
    nu[i], nu[j] = along, across
    u, v, w = nu[:3]
    a = PIONEER.added_mass
    munk = [(a[1] - a[2]) * v * w, (a[2] - a[0]) * u * w, (a[0] - a[1]) * u * v]
    lift = wake_lift(wake_fins(PIONEER, share), (u, v, w, 0.0, 0.0, 0.0))
    assert lift[3:] == pytest.approx([-share * m for m in munk], abs=1e-9)


@law
@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-pi, pi))
def test_a_tilted_hull_is_turned_back_upright_and_net_buoyancy_lifts_along_the_worlds_down(
    roll: float, pitch: float, heading: float
) -> None:
    weight, buoyancy = PIONEER.mass * GRAVITY, full_buoyancy(PIONEER)
    down = down_in_body(from_euler(roll, pitch, heading))
    g = restoring(weight, buoyancy, PIONEER.metacentric_height, down)
    arm = buoyancy * PIONEER.metacentric_height
    # On the left-hand side of the equation: the moment itself is −g, against the tilt.
    assert g[3:] == pytest.approx((arm * cos(pitch) * sin(roll), arm * sin(pitch), 0), abs=1e-9)
    assert g[:3] == pytest.approx([PIONEER.net_buoyancy * along for along in down], abs=1e-9)


def test_the_submerged_share_goes_from_none_to_all_over_the_hulls_height() -> None:
    assert submerged_share(0.4, -0.3) == 0.0
    assert submerged_share(0.4, 0.0) == 0.5
    assert submerged_share(0.4, 0.1) == pytest.approx(0.75)
    assert submerged_share(0.4, 5.0) == 1.0
    carried = submerged_share(PIONEER.size[2], PIONEER.floating_depth) * full_buoyancy(PIONEER)
    assert carried == pytest.approx(PIONEER.mass * GRAVITY)


decode: Callable[..., Any] = msgspec.toml.decode


# UNESCO technical papers in marine science 36 (1981), at atmospheric pressure.
@pytest.mark.parametrize(
    ("temperature", "salinity", "expected"),
    [(5.0, 0.0, 999.96675), (25.0, 0.0, 997.04796), (5.0, 35.0, 1027.67547),
     (25.0, 35.0, 1023.34306)],
)  # fmt: skip
def test_density_is_that_of_the_published_check_values(
    temperature: float, salinity: float, expected: float
):
    assert density(temperature, salinity) == pytest.approx(expected, abs=1e-5)


class Place(msgspec.Struct):
    water_density: Density


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1010.0", 1010.0), ('"fresh"', 1000.0), ('"sea"', SEA_WATER),
     ("{ temperature = 5.0, salinity = 35.0 }", density(5.0, 35.0))],
)  # fmt: skip
def test_a_vehicle_file_may_say_it_in_each_way(text: str, expected: float):
    place = decode(f"water_density = {text}", type=Place)
    assert density_of(place.water_density) == expected


@pytest.mark.parametrize(
    "text", ["500.0", "nan", '"salty"', "{ temperature = 5.0 }",
             "{ temperature = 50.0, salinity = 35.0 }", "{ temperature = 5.0, salinity = -1.0 }"],
)  # fmt: skip
def test_what_is_no_water_is_refused(text: str):
    with pytest.raises(msgspec.ValidationError):
        decode(f"water_density = {text}", type=Place)
