"""The bounded law as feedback equals the bounded law as a plan.

Position, velocity and acceleration are continuous, so they are compared as they are. The jerk jumps
where one part of the plan ends: at that instant the value of either side is right.
"""

from math import inf

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from lindy.api.references import Limits, Ramp, Sample, solve
from lindy_research.laws.stepping import step, stepper
from services.reference.trajectory.minimum_jerk import reader

velocity = st.one_of(st.floats(-3.0, 3.0), st.just(0.5))
acceleration = st.one_of(st.floats(-4.0, 4.0), st.just(0.0))
limits = st.builds(Limits, st.floats(0.1, 20.0), st.one_of(st.just(inf), st.floats(0.05, 5.0)))
many = settings(max_examples=300, deadline=None)
INSTANT = 1e-9  # [s] per second of the plan; rounding moves the ends of its parts by less


def planned(v: float, a: float, target: float, lim: Limits) -> tuple[Ramp, float]:
    parts = tuple(solve(v, a, target, lim))
    return Ramp(lim, target=target, segments=parts), sum(part.duration for part in parts)


def assert_same(found: tuple[float, ...], expected: Sample, root: float = 1e-9) -> None:
    """Acceleration to within `root`."""
    assert found[:2] == pytest.approx(expected[:2], rel=1e-9, abs=1e-9)
    assert found[2] == pytest.approx(expected.acceleration, rel=1e-9, abs=root)


def assert_jerk(found: float, ramp: Ramp, t: float) -> None:
    """It is the jerk of a part of the plan that has this instant `t` [s], its ends included."""
    allowed = list[tuple[float, float]]()
    near, begin = INSTANT * (1 + t), 0.0
    for part in ramp.segments:
        since, left = t - begin, begin + part.duration - t
        if since >= -near and left >= -near:
            early, late = max(0.0, since - near), min(part.duration, since + near)
            allowed.append((part.at(early).jerk, part.at(late).jerk))
        begin += part.duration
    if t >= begin - near:
        allowed.append((0.0, 0.0))
    slack = 1e-9 * (1 + abs(found))
    assert any(min(ends) - slack <= found <= max(ends) + slack for ends in allowed), allowed


@many
@example(v=0.5, a=1.0, target=0.0, lim=Limits(0.278, 0.05), share=1.0)
@given(velocity, acceleration, velocity, limits, st.floats(0.0, 1.3))
def test_one_step_of_any_length_is_the_plan(
    v: float, a: float, target: float, lim: Limits, share: float
) -> None:
    ramp, total = planned(v, a, target, lim)
    here = step(0.0, v, a, target, *lim, share * total)
    assert_same(here, ramp.at(share * total))
    assert_jerk(here[3], ramp, share * total)


@many
@example(v=2.0, a=1.192092896e-07, target=2.0, lim=Limits(0.25), share=1.0, steps=11)
@given(velocity, acceleration, velocity, limits, st.floats(0.01, 1.3), st.integers(1, 40))
def test_many_steps_that_solve_anew_follow_the_plan(
    v: float, a: float, target: float, lim: Limits, share: float, steps: int
) -> None:
    """So dt does not matter, and parts of the law may end anywhere inside a step."""
    ramp, total = planned(v, a, target, lim)
    assume(total > 1e-6)
    advance = stepper(lim, share * total / steps)
    here = (0.0, v, a, 0.0)
    for k in range(steps):
        here = advance(*here[:3], target)
        # Near its end a plan depends on the root of what is left to the target, rounding included.
        assert_same(here, ramp.at(share * total * (k + 1) / steps), root=1e-6)


@many
@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=30), limits, st.floats(0.001, 0.5))
def test_with_a_target_that_changes_at_every_step_it_is_a_ramp_aimed_anew(
    targets: list[float], lim: Limits, dt: float
) -> None:
    ramp, advance = Ramp(lim), stepper(lim, dt)
    here = (0.0, 0.0, 0.0, 0.0)
    for k, target in enumerate(targets):
        ramp.aim(target, k * dt)
        here = advance(*here[:3], target)
        assert_same(here, ramp.at((k + 1) * dt))
        assert abs(here[2]) <= lim.acceleration * (1 + 1e-12)
        assert abs(here[3]) <= lim.jerk * (1 + 1e-9)


@many
@given(velocity, acceleration, velocity, limits, st.floats(0.0, 1.3))
def test_reading_a_plan_is_evaluating_it(
    v: float, a: float, target: float, lim: Limits, share: float
) -> None:
    ramp, total = planned(v, a, target, lim)
    read = reader(ramp.segments, target)
    assert_same(read(share * total), ramp.at(share * total))
    middle = 0.4321 * share * total
    assert_jerk(read(middle)[3], ramp, middle)


def test_the_jerk_is_that_of_the_plan_in_each_part_of_the_law() -> None:
    lim = Limits(2.0, 0.5)
    ramp, total = planned(0.0, -0.4, 1.5, lim)
    advance = stepper(lim, total / 97)
    here = (0.0, 0.0, -0.4, 0.0)
    for k in range(97):
        here = advance(*here[:3], 1.5)
        assert_jerk(here[3], ramp, total * (k + 1) / 97)


def test_no_change_at_all_stays_at_rest() -> None:
    assert stepper(Limits(1.0, 1.0), 0.1)(2.0, 0.5, 0.0, 0.5) == (2.05, 0.5, 0.0, 0.0)
    assert stepper(Limits(1.0), 0.1)(0.0, 0.0, 0.0, 5e-324)[1] == 5e-324
