"""The written-out equations of motion are the textbook's, term by term."""

from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Quaternion, Vec6
from services.marine.attitude import from_euler
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.simulator.vessel import equations_of_motion
from tests.support.textbook_vessel import TextbookVessel

PIONEER = Stack().section("vehicle", Vehicle)
motion = st.tuples(*[st.floats(-3, 3)] * 6)
attitude = st.builds(from_euler, st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))


def six(least: float, most: float) -> Any:
    return st.tuples(*[st.floats(least, most)] * 6)


def hull(added: Vec6, linear: Vec6, quadratic: Vec6, height: float, floats: float) -> Vehicle:
    return msgspec.structs.replace(
        PIONEER,
        added_mass=added,
        linear_damping=linear,
        quadratic_damping=quadratic,
        metacentric_height=height,
        net_buoyancy=floats,
    )


hulls = st.builds(hull, six(0.1, 50), six(0, 50), six(0, 50), st.floats(0, 0.3), st.floats(-20, 20))


@settings(max_examples=150, deadline=None)
@given(hulls, st.floats(0, 1), st.floats(-1, 3), attitude, motion, six(-50, 50))
def test_every_term_is_there_with_its_sign(
    vehicle: Vehicle, wake: float, depth: float, q_NB: Quaternion, nu: Vec6, tau: Vec6
) -> None:
    state = (0.0, 0.0, depth, *q_NB, *nu)
    expected = TextbookVessel(vehicle, wake, state, [0.0] * 4).rates(state, tau)[7:]
    ours = equations_of_motion(vehicle, wake)(depth, q_NB, nu, tau)
    assert ours == pytest.approx(expected, rel=1e-9, abs=1e-7)
