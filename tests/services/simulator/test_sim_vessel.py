"""Physics of the hull: its equations, energy, floor, surface and thrusters."""

from itertools import pairwise
from math import degrees, dist, pi, sin, sqrt
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.units import Quaternion, Vec6
from services.marine.attitude import from_euler, tilt, to_euler, to_world
from services.marine.hydrodynamics import full_buoyancy, system_inertia
from services.marine.vehicle import GRAVITY, Vehicle, driven
from services.simulator.settings import Settings
from services.simulator.vessel import STEP, State, Vessel, equations_of_motion
from tests.services.simulator import hulls
from tests.services.simulator.hulls import LEVEL, NEUTRAL, PIONEER, REST
from tests.support.textbook_vessel import TextbookVessel, kinetic_energy

motion = st.tuples(*[st.floats(-2, 2)] * 6)
attitude = st.builds(from_euler, st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))
law = settings(max_examples=40, deadline=None)


def vessel(
    vehicle: Vehicle = PIONEER,
    *,
    depth: float = 50.0,
    q_NB: Quaternion = LEVEL,
    nu: Vec6 = REST,
    floor: float = 100.0,
    wake: float = 1.0,
) -> Vessel:
    place = Settings(floor_depth=floor, wake_share=wake)
    return hulls.vessel(place, vehicle, at=(0.0, 0.0, depth), q_NB=q_NB, nu=nu)


def sail(ship: Vessel, seconds: float, step: float = STEP) -> list[State]:
    states = list[State]()
    for _ in range(round(seconds / step)):
        ship.advance(step)
        states.append(ship.state)
    return states


def on_floor(ship: Vessel) -> bool:
    return ship.around.floor_felt(ship.position, ship.attitude)


def q_of(state: State) -> Quaternion:
    return state[3], state[4], state[5], state[6]


def energy(vehicle: Vehicle, state: State) -> float:
    """[J] of motion and of tilt."""
    _, _, _, _, _, _, _, u, v, w, p, q, r = state
    upright = 1 - 2 * (state[4] ** 2 + state[5] ** 2)
    righting = vehicle.mass * GRAVITY * vehicle.metacentric_height * (1 - upright)
    return kinetic_energy(system_inertia(vehicle), (u, v, w, p, q, r)) + righting


@law
@given(attitude, motion, st.floats(0, 1))
def test_without_thrust_a_neutral_vehicle_only_loses_energy(
    q_NB: Quaternion, nu: Vec6, wake: float
) -> None:
    ship = vessel(NEUTRAL, q_NB=q_NB, nu=nu, wake=wake)
    history = [energy(NEUTRAL, ship.state), *(energy(NEUTRAL, s) for s in sail(ship, 2.0))]
    assert all(b <= a + 1e-9 for a, b in pairwise(history))
    assert history[-1] < history[0] or history[0] < 1e-9


@law
@given(attitude, motion)
def test_without_drag_energy_is_kept(q_NB: Quaternion, nu: Vec6) -> None:
    slick = replace(NEUTRAL, linear_damping=REST, quadratic_damping=REST)
    ship = vessel(slick, q_NB=q_NB, nu=nu, wake=0.0)
    before = energy(slick, ship.state)
    sail(ship, 0.5)
    # The integrator's own error: at worst 2.0e-3, and 5 times less with half the step. Any real
    # hull's drag takes far more.
    assert energy(slick, ship.state) == pytest.approx(before, rel=4e-3, abs=1e-7)


@law
@given(attitude, motion, st.tuples(*[st.floats(-35, 35)] * 4))
def test_the_quaternion_stays_a_unit(
    q_NB: Quaternion, nu: Vec6, thrust: tuple[float, float, float, float]
) -> None:
    ship = vessel(q_NB=q_NB, nu=nu)
    ship.propulsion.drive(thrust)
    sail(ship, 1.0)
    assert sum(x * x for x in q_of(ship.state)) == pytest.approx(1.0, abs=1e-12)


def test_from_below_it_rises_to_the_surface_and_floats() -> None:
    ship = vessel(depth=1.0)
    depths = [s[2] for s in sail(ship, 60.0)]
    last = depths[-2000:]  # it bobs a little for long: we model no waves, which would brake it
    assert sum(last) / len(last) == pytest.approx(PIONEER.floating_depth, abs=0.005)
    assert max(last) - min(last) < 0.05


def test_surge_ends_where_drag_balances_thrust() -> None:
    linear, quadratic = NEUTRAL.linear_damping[0], NEUTRAL.quadratic_damping[0]
    expected = (sqrt(linear**2 + 4 * quadratic * 70.0) - linear) / (2 * quadratic)
    ship = vessel(NEUTRAL)
    ship.propulsion.drive([35.0, 35.0, 0.0, 0.0])
    sail(ship, 10.0)
    assert expected == pytest.approx(1.6, abs=0.05)
    assert ship.state[7] == pytest.approx(expected, rel=1e-3)


def test_at_full_surge_with_net_buoyancy_it_keeps_nearly_level() -> None:
    ship = vessel()
    ship.propulsion.drive([35.0, 35.0, 0.0, 0.0])
    assert all(degrees(tilt(q_of(s))) < 10 for s in sail(ship, 15.0))


@pytest.mark.parametrize("axis", [0, 1])
def test_tilted_it_swings_at_the_frequency_of_its_metacentric_height(axis: int) -> None:
    light = replace(NEUTRAL, linear_damping=(0.0,) * 3 + (0.02,) * 3, quadratic_damping=REST)
    start = from_euler(*((0.05, 0.0) if axis == 0 else (0.0, 0.05)), 0.0)
    inertia = system_inertia(light)[3 + axis]
    expected = sqrt(full_buoyancy(light) * light.metacentric_height / inertia)
    angles = [to_euler(q_of(s))[axis] for s in sail(vessel(light, q_NB=start, wake=0.0), 10.0)]
    crossings = [i for i in range(1, len(angles)) if angles[i - 1] > 0 >= angles[i]]
    period = STEP * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    assert len(crossings) >= 3
    assert 2 * pi / period == pytest.approx(expected, rel=0.01)


@law
@given(st.floats(-2.5, 2.5), st.floats(-1.2, 1.2))
def test_tilted_it_comes_back_upright(roll: float, pitch: float) -> None:
    ship = vessel(q_NB=from_euler(roll, pitch, 0.3))
    sail(ship, 10.0)
    assert tilt(q_of(ship.state)) < 0.02


def test_full_thrust_down_does_not_push_it_through_the_floor() -> None:
    ship = vessel(depth=3.0, floor=6.0)
    ship.propulsion.drive([0.0, 0.0, 0.0, 35.0])
    bottom = PIONEER.size[2] / 2
    deepest = max(s[2] + bottom - 6.0 for s in sail(ship, 12.0))
    assert 0 < deepest < 0.03
    assert on_floor(ship)
    assert abs(ship.state[9]) < 1e-3
    ship.propulsion.drive([0.0, 0.0, 0.0, -10.0])
    sail(ship, 3.0)
    assert not on_floor(ship)
    assert ship.state[2] < 5.0


def test_a_heavy_vehicle_thrown_sideways_onto_the_floor_stops_and_stays_stable() -> None:
    heavy = replace(PIONEER, net_buoyancy=-20.0)
    ship = vessel(heavy, depth=5.0, floor=5.5, nu=(2.0, -1.5, 3.0, 2.0, -2.0, 1.0))
    sail(ship, 10.0)
    assert on_floor(ship)
    assert max(abs(n) for n in ship.state[7:]) < 1e-3
    assert tilt(q_of(ship.state)) < 0.01


@law
@given(attitude, st.floats(-0.4, 0.4))
def test_a_thruster_produces_when_it_is_below_the_surface_and_only_then(
    q_NB: Quaternion, depth: float
) -> None:
    thrust, state = [10.0] * len(PIONEER.thruster), (0.0, 0.0, depth, *q_NB, *REST)
    ship = Vessel(PIONEER, Settings(), state, thrust)
    for thruster, newtons in zip(PIONEER.thruster, ship.propulsion.produced, strict=True):
        deep = depth + to_world(q_NB, thruster.position)[2]
        assert newtons == (10.0 if deep >= 0.0 else 0.0) or abs(deep) < 1e-9


def test_integration_converges_with_second_order() -> None:
    def end(step: float) -> State:
        ship = vessel(nu=(0.8, 0.2, 0.3, 0.5, -0.4, 1.0))
        ship.propulsion.drive([20.0, 5.0, 10.0, 4.0])
        return sail(ship, 1.28, step)[-1]

    best = end(0.0003125)
    coarse, fine = (
        max(abs(a - b) for a, b in zip(end(h), best, strict=True)) for h in (0.005, 0.0025)
    )
    assert coarse < 2e-5
    assert 3.5 < coarse / fine < 4.5


@pytest.mark.slow
def test_a_minute_of_hard_driving_ends_within_a_millimetre_of_the_textbook() -> None:
    """The reference is the classic Runge-Kutta method at a millisecond, on textbook formulas."""
    vehicle = PIONEER
    state: State = (0.0, 0.0, 10.0, *LEVEL, *REST)
    none = [0.0] * len(vehicle.thruster)
    ours = Vessel(vehicle, Settings(floor_depth=1000.0), state, none)
    textbook = TextbookVessel(vehicle, 1.0, state, none)
    for second in range(60):
        command = [
            driven(t, 0.5 * t.max_thrust * sin(0.37 * second * (1 + 0.31 * i)))
            for i, t in enumerate(vehicle.thruster)
        ]
        ours.propulsion.drive(command)
        textbook.aim(command)
        ours.advance(1.0)
        for _ in range(1000):
            textbook.step(0.001)
        assert dist(ours.position, textbook.state[:3]) < 1e-3  # [m]; 0.06 mm as measured


@law
@given(st.floats(1e-6, STEP - 1e-6), motion)
def test_cutting_a_step_in_two_changes_nothing_that_matters(cut: float, nu: Vec6) -> None:
    whole, parts = vessel(nu=nu), vessel(nu=nu)
    for ship in (whole, parts):
        ship.propulsion.drive([30.0, -10.0, 5.0, 20.0])
    whole.advance(STEP)
    parts.advance(cut)
    parts.advance(STEP - cut)
    assert parts.state == pytest.approx(whole.state, abs=2e-3)  # the step's own error


def test_a_motion_that_diverges_ends_the_simulator_with_a_sentence() -> None:
    ship = vessel(nu=(1e7, 0.0, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(FloatingPointError, match="diverged"):
        sail(ship, 0.1)


def six(least: float, most: float) -> Any:
    return st.tuples(*[st.floats(least, most)] * 6)


def hull(added: Vec6, linear: Vec6, quadratic: Vec6, height: float, floats: float) -> Vehicle:
    return replace(
        PIONEER, added_mass=added, linear_damping=linear, quadratic_damping=quadratic,
        metacentric_height=height, net_buoyancy=floats,
    )  # fmt: skip


shapes = st.builds(
    hull, six(0.1, 50), six(0, 50), six(0, 50), st.floats(0, 0.3), st.floats(-20, 20)
)


@settings(max_examples=150, deadline=None)
@given(shapes, st.floats(0, 1), st.floats(-1, 3), attitude, motion, six(-50, 50))
def test_every_term_is_there_with_its_sign(
    vehicle: Vehicle, wake: float, depth: float, q_NB: Quaternion, nu: Vec6, tau: Vec6
) -> None:
    state = (0.0, 0.0, depth, *q_NB, *nu)
    expected = TextbookVessel(vehicle, wake, state, [0.0] * 4).rates(state, tau)[7:]
    ours = equations_of_motion(vehicle, wake)(depth, q_NB, nu, tau)
    assert ours == pytest.approx(expected, rel=1e-9, abs=1e-7)
