"""Water brakes, carries and rights."""

from math import cos, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Vec6
from services.marine.attitude import down_in_body, from_euler
from services.marine.hydrodynamics import (
    damping,
    full_buoyancy,
    submerged_share,
    wake_fins,
    wake_lift,
)
from services.marine.vehicle import GRAVITY, Vehicle
from services.runtime.config.stack import Stack
from tests.support.textbook_vessel import restoring

PIONEER = Stack().section("vehicle", Vehicle)
motion = st.tuples(*[st.floats(-3, 3)] * 6)
axis = st.integers(0, 2)
law = settings(max_examples=100, deadline=None)


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
def test_a_tilted_hull_is_turned_back_upright(roll: float, pitch: float, heading: float) -> None:
    weight, buoyancy = PIONEER.mass * GRAVITY, full_buoyancy(PIONEER)
    down = down_in_body(from_euler(roll, pitch, heading))
    g = restoring(weight, buoyancy, PIONEER.metacentric_height, down)
    arm = buoyancy * PIONEER.metacentric_height
    # On the left-hand side of the equation: the moment itself is −g, against the tilt.
    assert g[3:] == pytest.approx((arm * cos(pitch) * sin(roll), arm * sin(pitch), 0), abs=1e-9)


def test_net_buoyancy_lifts_along_the_worlds_down_axis() -> None:
    weight, buoyancy = PIONEER.mass * GRAVITY, full_buoyancy(PIONEER)
    down = down_in_body(from_euler(0.0, pi / 2, 0.0))  # nose straight up
    g = restoring(weight, buoyancy, 0.03, down)
    assert g[:3] == pytest.approx((-PIONEER.net_buoyancy, 0.0, 0.0), abs=1e-9)


def test_the_submerged_share_goes_from_none_to_all_over_the_hulls_height() -> None:
    assert submerged_share(0.4, -0.3) == 0.0
    assert submerged_share(0.4, 0.0) == 0.5
    assert submerged_share(0.4, 0.1) == pytest.approx(0.75)
    assert submerged_share(0.4, 5.0) == 1.0
    carried = submerged_share(PIONEER.size[2], PIONEER.floating_depth) * full_buoyancy(PIONEER)
    assert carried == pytest.approx(PIONEER.mass * GRAVITY)
