"""The law of one axis, with each windup guard alone."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.reference import Motion
from services.control.axis_law import AxisLaw, Gains, Plant

GAINS = Gains(kp=50.0, kd=40.0, ki=10.0, max_error=0.3, max_integral=8.0)
PLANT = Plant(inertia=20.0, linear=0.4, quadratic=25.0)
DT = 0.01


def hold(position: float) -> Motion:
    return Motion(position, 0.0, 0.0, 0.0)


def law(**more: float) -> AxisLaw:
    base = {"kp": 50.0, "kd": 40.0, "ki": 10.0, "max_error": 0.3, "max_integral": 8.0}
    return AxisLaw(Gains(**(base | more)), PLANT)


@given(st.floats(-1, 1), st.floats(-2, 2), st.floats(-1, 1))
def test_on_the_reference_only_the_feed_forward_acts(x: float, v: float, a: float) -> None:
    effort = law().step(Motion(x, v, a, 0.0), x, v, DT)
    expected = PLANT.inertia * a + PLANT.linear * v + PLANT.quadratic * v * abs(v)
    assert effort.total == pytest.approx(expected)


def test_an_undisturbed_plant_follows_the_feed_forward_exactly() -> None:
    axis, x, v, dt = law(), 0.0, 0.0, 1e-4
    for k in range(10_000):
        t = k * dt
        want = Motion(t**3 / 6, t**2 / 2, t, 1.0)
        u = axis.step(want, x, v, dt).total
        x, v = x + v * dt, v + (u - PLANT.linear * v - PLANT.quadratic * v * abs(v)) / 20.0 * dt
    assert v == pytest.approx(0.5, abs=1e-3)
    assert x == pytest.approx(1 / 6, abs=1e-3)


def test_a_constant_disturbance_is_learnt() -> None:
    axis, x, v = law(), 0.0, 0.0
    for _ in range(3000):
        u = axis.step(hold(0.0), x, v, DT).total - 1.0
        x, v = x + v * DT, v + u / 20.0 * DT
    assert x == pytest.approx(0.0, abs=1e-3)
    assert axis.integral == pytest.approx(1.0, abs=0.02)


@given(st.floats(-0.5, 0.5), st.floats(-1, 1))
def test_the_integral_pauses_during_requested_motion(velocity: float, error: float) -> None:
    axis = law()
    axis.integral = 0.5 if error >= 0 else -0.5
    before = axis.integral
    moving = Motion(error, velocity or 0.1, 0.1, 0.0)
    axis.step(moving, 0.0, 0.0, DT)
    assert axis.integral == before


def test_guard_1_clamps_the_position_error() -> None:
    near, far = law(ki=0.0).step(hold(0.3), 0.0, 0.0, DT), law(ki=0.0).step(hold(9.0), 0, 0, DT)
    assert far.total == near.total == 50.0 * 0.3
    assert far.clamped
    assert not near.clamped


def test_guard_2_clamps_the_integral() -> None:
    axis = law()
    efforts = [axis.step(hold(0.09), 0.0, 0.0, DT) for _ in range(2000)]
    assert axis.integral == 8.0
    assert efforts[-1].clamped


def test_guard_3_lets_a_contrary_integral_decay() -> None:
    axis = law(decay=0.9)
    axis.integral = 5.0
    axis.step(hold(-0.2), 0.0, 0.0, DT)
    assert axis.integral == pytest.approx(4.5)
    axis.integral = 5.0
    axis.step(hold(-0.05), 0.0, 0.0, DT)  # below the threshold the law stays linear
    assert axis.integral == pytest.approx(5.0 - 10.0 * 0.05 * DT)


@settings(max_examples=100)
@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-2, 2)), min_size=1, max_size=200))
def test_the_integral_never_leaves_its_limits(moves: list[tuple[float, float]]) -> None:
    axis = law()
    for target, x in moves:
        axis.step(hold(target), x, 0.0, DT)
        assert abs(axis.integral) <= 8.0
