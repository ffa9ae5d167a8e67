"""The generators that ours is compared with do what they are known for."""

from itertools import pairwise
from math import inf, sqrt
from typing import Any

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from lindy.api.references import Filter, Limits, PlannedBaseline, Ramp, minimum_time, solve

velocity = st.floats(-3.0, 3.0)
acceleration = st.floats(-4.0, 4.0)
limits = st.builds(Limits, st.floats(0.1, 20.0), st.one_of(st.just(inf), st.floats(0.05, 5.0)))
many = settings(max_examples=100, deadline=None)


def total(v: float, a: float, target: float, lim: Limits) -> float:
    return sum(part.duration for part in minimum_time(v, a, target, lim))


@many
@given(velocity, acceleration, velocity, limits)
def test_minimum_time_arrives_within_its_limits(
    v: float, a: float, target: float, lim: Limits
) -> None:
    parts = minimum_time(v, a, target, lim)
    assume(parts)
    assert (parts[0].v0, parts[0].a0) == (v, a)
    for before, after in pairwise(parts):
        end = before.at(before.duration)
        assert end.velocity == pytest.approx(after.v0, abs=1e-9)
        assert end.acceleration == pytest.approx(after.a0, abs=1e-9)
    for part in parts:
        assert abs(part.j0) in (0.0, lim.jerk)
        assert abs(part.a0) <= max(abs(a), lim.acceleration) + 1e-9
    end = parts[-1].at(parts[-1].duration)
    assert end.velocity == pytest.approx(target, abs=1e-8)
    assert end.acceleration == pytest.approx(0.0, abs=1e-9)


@many
@given(velocity, acceleration, velocity, limits)
def test_nothing_is_quicker_than_minimum_time(
    v: float, a: float, target: float, lim: Limits
) -> None:
    bounded = sum(part.duration for part in solve(v, a, target, lim))
    # A change below the rounding of v is none to one and its root in time to the other.
    assert total(v, a, target, lim) <= bounded * (1 + 1e-9) + 1e-6


@many
@example(v=0.0, a=5e-324, target=5e-324, lim=Limits(0.5, inf))
@given(velocity, acceleration, velocity, limits)
def test_minimum_time_is_as_quick_as_ruckig(v: float, a: float, target: float, lim: Limits) -> None:
    ruckig: Any = pytest.importorskip("ruckig")
    wish = ruckig.InputParameter(1)
    wish.control_interface = ruckig.ControlInterface.Velocity
    wish.current_position, wish.current_velocity, wish.current_acceleration = [0.0], [v], [a]
    wish.target_velocity, wish.target_acceleration = [target], [0.0]
    wish.max_acceleration, wish.max_jerk = [min(lim.acceleration, 1e6)], [lim.jerk]
    trajectory = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(wish, trajectory)
    parts = minimum_time(v, a, target, lim)
    assert total(v, a, target, lim) == pytest.approx(trajectory.duration, rel=1e-6, abs=1e-6)
    distance = sum(part.at(part.duration).position for part in parts)
    there = trajectory.at_time(trajectory.duration)[0][0]
    assert distance == pytest.approx(there, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(("step", "T", "peak"), [(0.1, 0.2, 1.0), (1.0, 0.63245553, 3.16227766)])
def test_the_steps_of_figures_4_2_and_4_3(step: float, T: float, peak: float) -> None:
    parts = minimum_time(0.0, 0.0, step, Limits(10.0))
    assert total(0.0, 0.0, step, Limits(10.0)) == pytest.approx(T, rel=1e-8)
    assert parts[1].a0 == pytest.approx(peak, rel=1e-8)


# damping → peak acceleration and overshoot of a unit step at w = 10 rad/s, with 15 digits
KNOWN = [(0.7, 4.585679496, 0.045987910), (0.8, 4.240086266, 0.015164620), (0.9, 3.940593, 0.0015)]


@pytest.mark.parametrize(("damping", "peak", "overshoot"), KNOWN)
def test_the_filter_of_figures_4_2_and_4_3(damping: float, peak: float, overshoot: float) -> None:
    filter_ = Filter(10.0, damping)
    filter_.aim(1.0, 0.0)
    here = [filter_.at(k * 1e-4) for k in range(20_000)]
    assert here[0].jerk == pytest.approx(100.0)
    assert max(s.acceleration for s in here) == pytest.approx(peak, rel=1e-5)
    assert max(s.velocity for s in here) - 1 == pytest.approx(overshoot, rel=3e-2)
    assert filter_.at(20.0).position == pytest.approx(20.0 - 2 * damping / 10, rel=1e-9)


@many
@given(st.floats(0.5, 20.0), st.floats(0.1, 3.0), acceleration, velocity, st.floats(0.0, 3.0))
def test_the_filter_obeys_its_equation(
    w: float, damping: float, a: float, target: float, t: float
) -> None:
    filter_ = Filter(w, damping, velocity=0.3, acceleration=a, target=target)
    h = 1e-4 / w
    before, here, after = (filter_.at(t + k * h) for k in (0, 1, 2))
    size = 1e-6 * (1 + w) ** 3 * 10
    assert (after.position - before.position) / (2 * h) == pytest.approx(here.velocity, abs=size)
    assert (after.velocity - before.velocity) / (2 * h) == pytest.approx(
        here.acceleration, abs=size
    )
    assert (after.acceleration - before.acceleration) / (2 * h) == pytest.approx(
        here.jerk, abs=size
    )
    spring = w * w * (target - here.velocity) - 2 * damping * w * here.acceleration
    assert here.jerk == pytest.approx(spring, rel=1e-9, abs=1e-9)


@many
@given(st.lists(st.tuples(st.floats(0.0, 1.5), velocity), min_size=1, max_size=6), limits)
def test_any_planner_as_a_reference_is_what_the_ramp_is(
    moves: list[tuple[float, float]], lim: Limits
) -> None:
    ramp, planned = (
        Ramp(lim),
        PlannedBaseline(lambda v, a, target: solve(v, a, target, lim), target=0.0),
    )
    now = 0.0
    for wait, target in moves:
        now += wait
        ramp.aim(target, now)
        planned.aim(target, now)
        assert tuple(planned.at(now + 0.3)) == pytest.approx(tuple(ramp.at(now + 0.3)), abs=1e-9)


def test_lag_is_that_of_the_science() -> None:
    """Half the change times the duration, for minimum jerk and for minimum time."""
    lim, lags = Limits(10.0), list[float]()
    for law in (solve, minimum_time):
        parts = law(0.0, 0.0, 1.0, lim)
        length = sum(part.duration for part in parts)
        lags.append(length - sum(part.at(part.duration).position for part in parts))
    assert lags[0] == pytest.approx(sqrt(0.6) / 2)
    assert lags[1] == pytest.approx(sqrt(0.4) / 2)
