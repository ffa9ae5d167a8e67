"""The thesis' own rule, with what holds of it and what does not."""

from math import sqrt

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lindy.api.references import Limits, solve, thesis_rule
from lindy_research.laws import thesis_steps

velocity = st.floats(-3.0, 3.0)
acceleration = st.floats(-4.0, 4.0)
jerk = st.floats(0.1, 20.0)
many = settings(max_examples=100, deadline=None)


@many
@given(velocity, acceleration, velocity, jerk)
def test_the_plan_arrives_with_the_planned_end_jerk(
    v: float, a: float, target: float, J: float
) -> None:
    assume(abs(a) > 1e-6 or abs(target - v) > 1e-6)
    part = thesis_rule.plan(v, a, target, J)
    assert part is not None
    end = part.at(part.duration)
    assert (part.v0, part.a0) == (v, a)
    assert end.velocity == pytest.approx(target, abs=1e-9)
    assert end.acceleration == pytest.approx(0.0, abs=1e-7)
    assert abs(end.jerk) == pytest.approx(J, rel=1e-6)


@many
@given(velocity, acceleration, velocity, jerk)
def test_the_duration_is_the_largest_real_root(v: float, a: float, target: float, J: float) -> None:
    e = target - v
    roots = [
        (sign * -2 * a + s * 2 * sqrt(square)) / (2 * J)
        for sign in (1.0, -1.0)
        if (square := a * a + sign * 6 * J * e) >= 0
        for s in (1.0, -1.0)
    ]
    found = thesis_rule.duration(v, a, target, J)
    assert found == pytest.approx(max(roots, default=0.0), rel=1e-7, abs=1e-9)


@many
@given(velocity, acceleration, velocity, jerk, st.floats(0.05, 0.95))
def test_solving_again_on_the_way_changes_nothing(
    v: float, a: float, target: float, J: float, share: float
) -> None:
    """Property 1, from any state; on the surface where the rule jumps, rounding decides."""
    assume(abs(a * a - 6 * J * abs(target - v)) > 1e-3)
    part = thesis_rule.plan(v, a, target, J)
    assert part is not None
    assume(part.duration > 1e-3)
    here = part.at(share * part.duration)
    rest = thesis_rule.duration(here.velocity, here.acceleration, target, J)
    assert rest == pytest.approx((1 - share) * part.duration, rel=1e-7, abs=1e-9)


@many
@given(velocity, acceleration, velocity, jerk, st.floats(0.01, 1.5))
def test_a_step_follows_the_plan_and_its_exact_position(
    v: float, a: float, target: float, J: float, share: float
) -> None:
    part = thesis_rule.plan(v, a, target, J)
    assume(part is not None and part.duration > 1e-6)
    assert part is not None
    t = share * part.duration
    x, v1, a1, _ = thesis_steps.step(1.0, v, a, target, J, t)
    here = part.at(min(t, part.duration))
    beyond = target * max(0.0, t - part.duration)
    assert x == pytest.approx(1.0 + here.position + beyond, rel=1e-9, abs=1e-9)
    assert v1 == pytest.approx(here.velocity, abs=1e-9)
    assert a1 == pytest.approx(here.acceleration, abs=1e-6)


@many
@given(velocity, velocity, jerk, st.floats(0.0, 1.0))
def test_where_the_thesis_keeps_its_jerk_the_bounded_law_is_the_same(
    v: float, target: float, J: float, share: float
) -> None:
    e = target - v
    assume(abs(e) > 1e-6)
    a = share * sqrt(2 * J * abs(e)) * (1 - 1e-12) * (1 if e > 0 else -1)
    (ours,) = solve(v, a, target, Limits(J))
    theirs = thesis_rule.plan(v, a, target, J)
    assert theirs == pytest.approx(ours, rel=1e-9)


# v1, a1, v2, J → T, peak jerk, displacement, with 40 digits
GOLDEN = [
    (0.0, 0.0, 0.3, 3.0, 0.7745966692, 3.0, 0.1161895004),
    (0.2, 0.5, 0.8, 2.0, 1.1147344064, 2.0, 0.6091435697),
    (0.2, -0.5, 0.8, 2.0, 1.6147344064, 2.6192968924, 0.6987269031),
    (0.0, 1.5, 1.0, 1.0, 1.3722813233, 1.1861406616, 0.9215351654),
    (0.0, 2.0, 0.5, 1.0, 3.0, 2.3333333333, 2.25),
    (0.5, 0.4, 0.5, 1.0, 0.8, 2.0, 0.4213333333),
    (1.0, -0.3, -1.0, 2.0, 2.3040782384, 2.0, -0.1327194132),
    (0.0, 0.45, 0.05, 1.0, 0.2588723439, 2.4766170318, 0.00898486699),
]


@pytest.mark.parametrize(("v1", "a1", "v2", "J", "T", "peak", "distance"), GOLDEN)
def test_known_transitions_with_their_broken_jerk_bound(
    v1: float, a1: float, v2: float, J: float, T: float, peak: float, distance: float
) -> None:
    part = thesis_rule.plan(v1, a1, v2, J)
    assert part is not None
    assert part.duration == pytest.approx(T, rel=1e-9)
    end = part.at(part.duration)
    assert max(abs(part.j0), abs(end.jerk)) == pytest.approx(peak, rel=1e-9)
    assert end.position == pytest.approx(distance, rel=1e-9)


def test_the_rule_jumps_where_the_docstring_says() -> None:
    below = thesis_rule.duration(0.0, sqrt(6.0) - 1e-9, 1.0, 1.0)
    above = thesis_rule.duration(0.0, sqrt(6.0) + 1e-9, 1.0, 1.0)
    assert above / below == pytest.approx(1 + sqrt(2), rel=1e-3)


def test_clamping_afterwards_moves_the_arrival() -> None:
    """Fig. 5.8, 0 to 2 with J 1 and a_max 0.5: 4.6149 s where the planned clamp takes 4.6667 s."""
    arrivals: list[float] = []
    for law in (thesis_steps.clamped_step, thesis_steps.planned_clamp_step):
        x = v = a = t = 0.0
        dt = 1e-3
        while (v, a) != (2.0, 0.0):
            x, v, a, _ = law(x, v, a, 2.0, 1.0, 0.5, dt)
            assert abs(a) <= 0.5
            t += dt
        arrivals.append(t)
    assert arrivals[0] == pytest.approx(4.614926, abs=3e-3)
    assert arrivals[1] == pytest.approx(4.666667, abs=3e-3)
