"""Allocation: what is asked for is what the thrusters add up to, as long as they can."""

from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.control.allocation import PILOTED, Allocation
from services.marine.vehicle import Vehicle
from services.runtime.stack import Stack

PIONEER = Stack().section("vehicle", Vehicle)
ALLOCATION = Allocation(PIONEER)
Wrench4 = tuple[float, float, float, float]
force = st.floats(-200.0, 200.0)
wrench = st.tuples(force, force, force, st.floats(-20.0, 20.0))
many = settings(max_examples=200, deadline=None)


def piloted(achieved: tuple[float, ...]) -> Wrench4:
    return cast(Wrench4, tuple(achieved[i] for i in PILOTED))


@many
@given(st.tuples(*[st.floats(-8.0, 8.0)] * 3, st.floats(-0.5, 0.5)))
def test_inside_the_limits_allocation_then_mixing_is_identity(wanted: Wrench4) -> None:
    done = ALLOCATION.allocate(wanted)
    assert piloted(done.achieved) == pytest.approx(wanted, abs=1e-9)
    assert done.saturated == ()


@many
@given(wrench)
def test_no_thruster_is_ever_asked_for_more_than_it_has(wanted: Wrench4) -> None:
    done = ALLOCATION.allocate(wanted)
    for thrust, thruster in zip(done.thrust, PIONEER.thruster, strict=True):
        assert abs(thrust) <= thruster.max_thrust


@many
@given(wrench)
def test_saturation_keeps_the_direction_of_the_horizontal_force(wanted: Wrench4) -> None:
    surge, sway, _, _ = piloted(ALLOCATION.allocate(wanted).achieved)
    scale = max(1.0, abs(wanted[0]), abs(wanted[1]))
    assert (surge * wanted[1] - sway * wanted[0]) / scale == pytest.approx(0.0, abs=1e-6)
    assert surge * wanted[0] >= -1e-9
    assert sway * wanted[1] >= -1e-9


@many
@given(st.floats(-30.0, 30.0), st.floats(-5.0, 5.0), force, force)
def test_heave_and_yaw_are_served_before_surge_and_sway(
    heave: float, yaw: float, surge: float, sway: float
) -> None:
    done = ALLOCATION.allocate((surge, sway, heave, yaw))
    got = piloted(done.achieved)
    assert got[2:] == pytest.approx((heave, yaw), abs=1e-6)


def test_a_full_vertical_thruster_does_not_cost_any_surge() -> None:
    done = ALLOCATION.allocate((30.0, 5.0, 500.0, 0.0))
    assert piloted(done.achieved) == pytest.approx((30.0, 5.0, 35.0, 0.0), abs=1e-6)
    assert done.saturated == ("vertical",)


@many
@given(wrench)
def test_a_shortfall_names_the_thruster(wanted: Wrench4) -> None:
    done = ALLOCATION.allocate(wanted)
    short = not np.allclose(piloted(done.achieved), wanted, atol=1e-6)
    assert short == bool(done.saturated)
