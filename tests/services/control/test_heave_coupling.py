"""What surge, sway and tilt do to heave is what the equations of motion say."""

from math import cos, sin, tan

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.message import Estimate
from messages.state import VehicleState
from messages.units import Vec3, Vec6
from services.control.heave_coupling import HeaveCoupling
from services.marine.attitude import down_in_body, from_euler
from services.marine.hydrodynamics import system_inertia
from services.marine.vehicle import Vehicle
from services.simulator.vessel import equations_of_motion
from tests.support.said import state

DEEP = 50.0  # [m]
LAG = 0.08  # [s]
TILTS = st.floats(-0.6, 0.6)
SPEEDS = st.floats(-1.5, 1.5)
RATES = st.floats(-1.0, 1.0)
WRENCHES = st.tuples(*[st.floats(-35.0, 35.0)] * 3, *[st.just(0.0)] * 3)


def known(value: float, *, valid: bool = True) -> Estimate:
    return Estimate(value, 0.01, valid)


def lying(
    roll: float, pitch: float, rate: float, yaw_rate: float, *, valid: bool = True
) -> VehicleState:
    unknown = () if valid else ("roll", "pitch")
    return state(
        invalid=unknown,
        depth=DEEP,
        depth_rate=rate,
        attitude=from_euler(roll, pitch, 0.7),
        roll=roll,
        pitch=pitch,
        heading=0.7,
        yaw_rate=yaw_rate,
    )


def euler_rates(roll: float, pitch: float, turning: Vec3) -> tuple[float, float]:
    """[rad/s] Of roll and pitch, from the body's (Fossen 2011, eq. 2.28)."""
    p, q, r = turning
    return p + (q * sin(roll) + r * cos(roll)) * tan(pitch), q * cos(roll) - r * sin(roll)


def weightless(vehicle: Vehicle) -> Vehicle:
    return msgspec.structs.replace(vehicle, net_buoyancy=0.0)


@settings(max_examples=200, deadline=None)
@given(TILTS, TILTS, st.tuples(*[SPEEDS] * 3), st.tuples(*[RATES] * 3), WRENCHES, st.floats(0, 1))
def test_with_it_the_law_knows_the_whole_vertical_force(
    pioneer: Vehicle,
    roll: float,
    pitch: float,
    velocity: Vec3,
    turning: Vec3,
    tau: Vec6,
    wake: float,
) -> None:
    vehicle, (u, v, w), (p, q, r) = weightless(pioneer), velocity, turning
    attitude = from_euler(roll, pitch, 0.7)
    a, b, c = down_in_body(attitude)
    du, dv, dw, *_ = equations_of_motion(vehicle, wake)(DEEP, attitude, (u, v, w, p, q, r), tau)
    fall = a * u + b * v + c * w
    faster = a * (du + q * w - r * v) + b * (dv + r * u - p * w) + c * (dw + p * v - q * u)
    coupling = HeaveCoupling(vehicle, LAG, wake, surge=u, sway=v)
    coupling.step(lying(roll, pitch, fall, r), euler_rates(roll, pitch, turning), tau, 0.0)
    drag = (vehicle.linear_damping[2] + vehicle.quadratic_damping[2] * abs(fall)) * fall
    by_the_law = coupling.upright * tau[2] - drag + coupling.force
    assert by_the_law == pytest.approx(system_inertia(vehicle)[2] * faster, abs=1e-8)


@given(SPEEDS, RATES, st.floats(-35.0, 35.0))
def test_a_level_vehicle_without_surge_and_sway_has_none(
    pioneer: Vehicle, rate: float, turning: float, heave: float
) -> None:
    coupling = HeaveCoupling(pioneer, LAG)
    thrust = (0.0, 0.0, heave, 0.0, 0.0, 0.0)
    for _ in range(3):
        coupling.step(lying(0.0, 0.0, rate, turning), (0.0, 0.0), thrust, 0.01)
        assert coupling.upright == 1.0
        assert coupling.force == pytest.approx(0.0, abs=1e-9)
        assert coupling.ahead(rate, thrust) == pytest.approx(0.0, abs=1e-9)


def test_while_the_tilt_is_not_known_the_vehicle_counts_as_level(pioneer: Vehicle) -> None:
    coupling = HeaveCoupling(pioneer, LAG)
    thrust = (0.0, 0.0, 10.0, 0.0, 0.0, 0.0)
    coupling.step(lying(0.3, 0.4, 0.3, 0.2, valid=False), (0.1, 0.1), thrust, 0.01)
    assert (coupling.upright, coupling.force) == (1.0, pytest.approx(0.0, abs=1e-9))


@settings(max_examples=20, deadline=None)
@given(st.floats(5.0, 30.0), st.floats(-20.0, 20.0))
def test_surge_and_sway_go_where_thrust_and_drag_are_equal(
    pioneer: Vehicle, surge: float, sway: float
) -> None:
    coupling = HeaveCoupling(pioneer, LAG, wake_share=0.0)
    thrust = (surge, sway, 0.0, 0.0, 0.0, 0.0)
    for _ in range(4000):
        coupling.step(lying(0.0, 0.0, 0.0, 0.0), (0.0, 0.0), thrust, 0.01)
    for force, speed, axis in ((surge, coupling.surge, 0), (sway, coupling.sway, 1)):
        drag = pioneer.linear_damping[axis] + pioneer.quadratic_damping[axis] * abs(speed)
        assert drag * speed == pytest.approx(force, abs=0.01)


@settings(max_examples=50, deadline=None)
@given(TILTS, TILTS, st.tuples(*[SPEEDS] * 2), st.tuples(*[RATES] * 3), WRENCHES)
def test_ahead_is_the_coupling_a_little_later(
    pioneer: Vehicle,
    roll: float,
    pitch: float,
    speed: tuple[float, float],
    turning: Vec3,
    thrust: Vec6,
) -> None:
    fall, r, lag = 0.2, turning[2], 1e-3
    coupling = HeaveCoupling(pioneer, lag, surge=speed[0], sway=speed[1])
    rates = euler_rates(roll, pitch, turning)
    coupling.step(lying(roll, pitch, fall, r), rates, thrust, 0.0)
    told = coupling.ahead(fall, thrust)
    coupling.step(lying(roll, pitch, fall, r), rates, thrust, lag)
    roll, pitch = roll + lag * rates[0], pitch + lag * rates[1]
    coupling.step(lying(roll, pitch, fall, r), euler_rates(roll, pitch, turning), thrust, 0.0)
    assert told == pytest.approx(coupling.force, abs=1e-3)
