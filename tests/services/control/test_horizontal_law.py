"""Forces that keep a place, and what surge, sway and tilt do to the other axes."""

from collections.abc import Callable
from math import cos, hypot, sin, tan

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.units import Vec3, Vec6
from services.control.axis.axis import Gains
from services.control.core import Controller
from services.control.heave_coupling import HeaveCoupling
from services.control.laws import Settings, along_body, of_heading, to_body, turning_force
from services.marine.attitude import down_in_body, from_euler
from services.marine.attitude import to_body as rotated
from services.marine.hydrodynamics import coriolis, damping, system_inertia
from services.marine.vehicle import Vehicle
from services.simulator.vessel import equations_of_motion
from tests.support import said
from tests.support.said import state
from tests.support.told import told

STEP = 10_000_000  # [ns]
PLACE = Gains(kp=30.0, kd=45.0, ki=6.0, max_error=0.5, max_integral=20.0, observer=1.0)
OURS = Settings(surge=PLACE, sway=PLACE)
ZERO = Motion(0.0, 0.0, 0.0, 0.0)
heading = st.floats(-10.0, 10.0)
metres = st.floats(-5.0, 5.0)


def seen(
    place: tuple[float, float],
    psi: float,
    velocity: tuple[float, float] = (0.0, 0.0),
    current: tuple[float, float] | None = None,
) -> VehicleState:
    flow = (None, None) if current is None else current
    return state(
        depth=2.0, heading=psi, heading_navigation=psi, north=place[0], east=place[1],
        surge_velocity=velocity[0], sway_velocity=velocity[1],
        current_north=flow[0], current_east=flow[1],
    )  # fmt: skip


def asked(north: Motion, east: Motion, psi: Motion) -> Reference:
    return said.reference(0, depth=at(2.0), heading=psi, north=north, east=east)


def at(position: float) -> Motion:
    return Motion(position, 0.0, 0.0, 0.0)


@settings(max_examples=50, deadline=None)
@given(heading, metres, metres)
def test_the_force_points_to_the_place(
    pioneer: Vehicle, psi: float, north: float, east: float
) -> None:
    law = Controller(OURS, pioneer, Outbox())
    wrench, _ = law.step(asked(at(north), at(east), at(psi)), seen((0.0, 0.0), psi), 0)
    x, y = wrench.wanted[:2]
    back = (cos(psi) * x - sin(psi) * y, sin(psi) * x + cos(psi) * y)
    share = min(1.0, 0.5 / max(0.5, hypot(north, east)))  # guard 1, of the whole way
    assert back == pytest.approx((30.0 * share * north, 30.0 * share * east), abs=1e-9)
    assert ("clamped:control.place" in law.outbox.counts) == (hypot(north, east) > 0.5)


@settings(max_examples=50, deadline=None)
@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
def test_the_feed_forward_is_that_of_the_equations_of_motion(
    pioneer: Vehicle, u: float, v: float, r: float, north: float, east: float
) -> None:
    """A turning vehicle on a reference with acceleration: M ν' + C(ν) ν + D(ν) ν of its plane."""
    inertia = system_inertia(pioneer)
    along, across = turning_force(inertia, (u, v), r)
    nu = (u, v, 0.0, 0.0, 0.0, r)
    changes = north + r * v, east - r * u  # dν/dt in turning axes, for acceleration (north, east)
    forces = coriolis(inertia, nu)
    drag = damping(pioneer.linear_damping, pioneer.quadratic_damping, nu)
    expected = [inertia[k] * changes[k] + forces[k] + drag[k] for k in (0, 1)]
    ours = inertia[0] * north + along + drag[0], inertia[1] * east + across + drag[1]
    assert ours == pytest.approx(expected, abs=1e-9)


def drift(vehicle: Vehicle, gains: Gains, told: Callable[[int], bool], steps: int) -> list[float]:
    """[m] From the place to be held, at each step, in half a knot from the north-east that the law
    is told of at these steps."""
    psi, flow, inertia = 0.7, (-0.18, -0.18), system_inertia(vehicle)
    law = Controller(Settings(surge=gains, sway=gains), vehicle, Outbox())
    place, velocity = [0.0, 0.0], [0.0, 0.0]  # NED; body over the ground
    water, away = to_body(psi, *flow), list[float]()
    for k in range(steps):
        north, east = place
        state = seen((north, east), psi, (velocity[0], velocity[1]), flow if told(k) else None)
        wrench, _ = law.step(asked(ZERO, ZERO, at(psi)), state, k * STEP)
        nu = velocity[0] - water[0], velocity[1] - water[1], 0.0, 0.0, 0.0, 0.0
        drag = damping(vehicle.linear_damping, vehicle.quadratic_damping, nu)
        for axis in (0, 1):
            velocity[axis] += (wrench.wanted[axis] - drag[axis]) / inertia[axis] * 0.01
        c, s = cos(psi), sin(psi)
        place[0] += (c * velocity[0] - s * velocity[1]) * 0.01
        place[1] += (s * velocity[0] + c * velocity[1]) * 0.01
        away.append(hypot(*place))
    return away


@pytest.mark.parametrize("known", [True, False])
def test_a_place_is_held_in_a_current(pioneer: Vehicle, known: bool) -> None:
    """Told or not, it stays within a hand's breadth; and with the current told it hardly moves."""
    away = drift(pioneer, PLACE, lambda _: known, 4000)
    assert away[-1] < 0.005
    assert max(away) < (0.01 if known else 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("gains", [PLACE, msgspec.structs.replace(PLACE, observer=0.0)])
def test_a_current_that_becomes_known_or_is_forgotten_makes_no_bump(
    pioneer: Vehicle, gains: Gains
) -> None:
    """What was learnt gives way to what is told, and takes over from it."""
    away = drift(pioneer, gains, lambda k: k // 3000 == 1 or k // 3000 == 3, 15000)
    assert max(away[3000:]) < 0.005


def test_a_current_that_was_known_before_a_disarm_pushes_nothing_after_it(pioneer: Vehicle) -> None:
    law, asks = Controller(OURS, pioneer, Outbox()), asked(ZERO, ZERO, at(0.7))
    disarmed = msgspec.structs.replace(asks, armed=False)
    known, unknown = seen((0.0, 0.0), 0.7, current=(-0.4, 0.2)), seen((0.0, 0.0), 0.7)
    law.step(asks, known, 0)
    law.step(disarmed, known, STEP)
    wrench, _ = law.step(asks, unknown, 2 * STEP)
    assert wrench.wanted[:2] == pytest.approx((0.0, 0.0), abs=1e-9)


def test_without_a_measured_place_the_reference_alone_drives_it(pioneer: Vehicle) -> None:
    law = Controller(OURS, pioneer, Outbox())
    lost = msgspec.structs.replace(seen((0.0, 0.0), 0.0), north=Estimate(0.0, 9.0, False))
    going = Motion(3.0, 0.4, 0.0, 0.0)
    wrench, _ = law.step(asked(going, ZERO, at(0.0)), lost, 0)
    expected = pioneer.linear_damping[0] * 0.4 + pioneer.quadratic_damping[0] * 0.16
    assert wrench.wanted[0] == pytest.approx(expected)
    assert wrench.wanted[1] == 0.0
    assert told(law.outbox) == ["invalid:state.position"]


def test_a_vehicle_that_dives_nose_down_is_not_pushed_for_a_motion_that_is_none(
    pioneer: Vehicle,
) -> None:
    """At 0.35 rad and 0.4 m/s straight down its surge is 0.137 m/s, and it stays over its place."""
    tilted = from_euler(0.0, -0.35, 0.7)
    surge, sway, _ = rotated(tilted, (0.0, 0.0, 0.4))
    level = seen((0.0, 0.0), 0.7, (surge, sway))
    state = msgspec.structs.replace(
        level, attitude=tilted, pitch=Estimate(-0.35, 0.01), depth_rate=Estimate(0.4, 0.01)
    )
    wrench, _ = Controller(OURS, pioneer, Outbox()).step(asked(ZERO, ZERO, at(0.7)), state, 0)
    assert wrench.wanted[:2] == pytest.approx((0.0, 0.0), abs=1e-9)


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
    return state(
        invalid=() if valid else ("roll", "pitch"), depth=DEEP, depth_rate=rate,
        attitude=from_euler(roll, pitch, 0.7), roll=roll, pitch=pitch, heading=0.7,
        yaw_rate=yaw_rate,
    )  # fmt: skip


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


@given(TILTS, TILTS, RATES, RATES)
def test_a_vehicle_on_its_reference_has_no_error_of_rate_at_any_tilt(
    roll: float, pitch: float, turning: float, pitching: float
) -> None:
    r = turning * cos(roll) * cos(pitch) - pitching * sin(roll)  # body, by the Euler rates
    wanted = along_body(Motion(1.0, turning, 0.0, 0.0), known(roll), known(pitch))
    measured = of_heading(known(r), known(roll), pitching)
    assert wanted.position == 1.0
    assert np.isclose(wanted.velocity, measured.value, atol=1e-12)


def test_level_and_unknown_tilt_change_nothing() -> None:
    motion, rate = Motion(1.0, 0.5, 0.2, 0.1), known(0.4)
    assert along_body(motion, known(0.0), known(0.0)) == motion
    assert along_body(motion, known(0.5), known(0.5, valid=False)) == motion
    assert of_heading(rate, known(0.0), 0.7) == rate
    assert of_heading(rate, known(0.5, valid=False), 0.7) == rate
