"""The velocity that the thrust makes expect: the hull's own, bounded, and none without reports."""

from math import hypot

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import events
from messages.units import Vec3
from messages.vehicle import Actuation
from services.estimation.attitude_axes import MOVING_STD, AttitudeAxes
from services.estimation.depth.thrust_speed import FASTEST, STILL_STD, ThrustSpeed
from services.marine.attitude import from_euler, to_world
from services.marine.vehicle import Vehicle, total_wrench, wrench_per_newton
from services.runtime.config.stack import Stack
from services.simulator.vessel import equations_of_motion

PIONEER = Stack().section("vehicle", Vehicle)
DT, DT_NS = 0.01, 10_000_000
PATIENCE = 0.5  # [s]
DEEP = 50.0  # [m]
STILL: Vec3 = (0.0, 0.0, 0.0)
ANGLES = st.floats(-0.6, 0.6)


def lying(roll: float, pitch: float, heading: float) -> AttitudeAxes:
    q = from_euler(roll, pitch, heading)
    return AttitudeAxes(to_world(q, (1.0, 0.0, 0.0)), to_world(q, (0.0, 1.0, 0.0)))


def a_report(thrust: list[float], at_ns: int) -> Actuation:
    return Actuation(
        stamp_ns=at_ns,
        thrust=tuple(thrust),
        actuated_ns=None,
        sensor_ns=None,
        pilot_ns=None,
        stale=False,
        power=0.0,
    )


class Run:
    """A hull whose thrusters push at `thrust` [N] each."""

    def __init__(self, vehicle: Vehicle, *, at_rest: bool = True) -> None:
        self.it = ThrustSpeed(vehicle, 1.0, at_rest=at_rest)
        self.now, self.events, self.axes = 0, list[str](), list[AttitudeAxes]()

    def steps(
        self, count: int, thrust: list[float] | None, axes: AttitudeAxes, depth_rate: float = 0.0
    ) -> "Run":
        for _ in range(count):
            if thrust is not None:
                self.it.actuation(a_report(thrust, self.now))
            self.events += [e.name for e in (self.it.silence(self.now),) if e]
            self.axes.append(self.it.step(axes, STILL, depth_rate, DT))
            self.now += DT_NS
        return self


@settings(max_examples=30, deadline=None)
@given(ANGLES, ANGLES, st.floats(-3.0, 3.0), st.data())
def test_it_is_the_velocity_of_the_equations_of_motion(
    roll: float, pitch: float, heading: float, data: st.DataObject
) -> None:
    count = len(PIONEER.thruster)
    thrust = data.draw(st.lists(st.floats(-5.0, 5.0), min_size=count, max_size=count))
    vehicle = msgspec.structs.replace(PIONEER, net_buoyancy=0.0)
    q, run = from_euler(roll, pitch, heading), Run(vehicle)
    tau = total_wrench([wrench_per_newton(t) for t in vehicle.thruster], thrust)
    motion = equations_of_motion(vehicle, 1.0)
    v = STILL
    for _ in range(200):  # the simulated hull is carried through the water, and does not turn
        _, _, fall = to_world(q, v)
        run.steps(1, thrust, lying(roll, pitch, heading), fall)
        x, y, z, *_ = motion(DEEP, q, (*v, 0.0, 0.0, 0.0), tau)
        v = v[0] + DT * x, v[1] + DT * y, v[2] + DT * z
    north, east, _ = to_world(q, v)
    assert run.axes[-1].velocity == pytest.approx((north, east), abs=0.02)
    assert (run.it.surge, run.it.sway) == pytest.approx(v[:2], abs=1e-6)


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.none() | st.floats(-1e308, 1e308), ANGLES, st.floats(-3.2, 3.2), st.floats(-3, 3)
        ),
        min_size=1,
        max_size=20,
    )
)
def test_whatever_is_reported_it_stays_finite_and_its_error_within_bounds(
    parts: list[tuple[float | None, float, float, float]],
) -> None:
    run = Run(PIONEER)
    for force, roll, pitch, depth_rate in parts:
        thrust = None if force is None else [force] * len(PIONEER.thruster)
        run.steps(20, thrust, lying(roll, pitch, 1.0), depth_rate)
    for axes in run.axes:
        assert hypot(*axes.velocity) < 10.0 * FASTEST
        assert STILL_STD <= axes.velocity_std <= MOVING_STD


def test_without_reports_it_fades_to_none_without_a_step_and_is_counted_once() -> None:
    level, ahead = lying(0.0, 0.0, 0.0), [8.0] * 4 + [0.0] * (len(PIONEER.thruster) - 4)
    run = Run(PIONEER).steps(300, ahead, level)
    before = run.axes[-1]
    assert run.events == []
    assert before.velocity_std < 0.8 * MOVING_STD  # by the share of its speed
    run.steps(1500, None, level)
    assert run.events == ["silent:vehicle/actuation"]
    assert run.axes[-1].velocity == pytest.approx((0.0, 0.0), abs=1e-3)
    assert run.axes[-1].velocity_std == pytest.approx(MOVING_STD, abs=1e-3)
    run.steps(1000, ahead, level)
    assert run.axes[-1].velocity == pytest.approx(before.velocity, abs=0.1)
    changes = [
        hypot(b.velocity[0] - a.velocity[0], b.velocity[1] - a.velocity[1])
        for a, b in zip(run.axes, run.axes[1:], strict=False)
    ]
    assert max(changes) < 0.03


def test_a_vehicle_that_was_not_at_rest_is_not_known_at_first() -> None:
    level, nothing = lying(0.0, 0.0, 0.0), [0.0] * len(PIONEER.thruster)
    run = Run(PIONEER, at_rest=False).steps(1, nothing, level)
    assert run.axes[-1].velocity_std > 0.95 * MOVING_STD
    run.steps(1000, nothing, level)
    assert run.axes[-1].velocity_std == pytest.approx(STILL_STD, abs=0.01)
    run.it.lost()
    run.steps(1, nothing, level)
    assert run.axes[-1].velocity_std > 0.95 * MOVING_STD


def test_a_report_of_another_length_is_not_used() -> None:
    run = Run(PIONEER)
    run.it.actuation(a_report([20.0], 0))
    run.steps(100, None, lying(0.0, 0.0, 0.0))
    assert run.axes[-1].velocity == (0.0, 0.0)


def test_thrust_that_a_thruster_does_not_have_is_limited_and_counted_once() -> None:
    most = [thruster.max_thrust for thruster in PIONEER.thruster]
    it = Run(PIONEER).it
    said = [
        it.actuation(a_report([share * f for f in most], n))
        for n, share in enumerate((1.0, 1.5, 2.0, 1.0, 1.5))
    ]
    clamped = events.CLAMPED("vehicle/actuation")
    assert said == [None, clamped, None, None, clamped]
