"""Velocity vectors change straight, within norm limits, in whatever frame."""

from math import cos, hypot, inf, pi, sin

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from services.reference.trajectory.minimum_jerk import Limits, Sample, solve
from services.reference.trajectory.vector import Pair, VectorRamp

number = st.floats(-2.0, 2.0, allow_subnormal=False)
pair = st.tuples(number, number)
limits = st.builds(Limits, st.floats(0.2, 10.0), st.one_of(st.just(inf), st.floats(0.1, 3.0)))
many = settings(max_examples=200, deadline=None)


def begun(v: Pair, a: Pair, target: Pair, lim: Limits) -> VectorRamp:
    """A change from any state, that begins at 0 s."""
    ramp = VectorRamp(lim)
    ramp.take(Sample(0.0, v[0], a[0], 0.0), Sample(0.0, v[1], a[1], 0.0), 0.0)
    ramp.aim(target, 0.0)
    return ramp


def norm(ramp: VectorRamp, t: float, what: str = "acceleration") -> float:
    return hypot(*(getattr(axis, what) for axis in ramp.at(t)))


@many
@given(pair, pair, pair, limits, st.floats(0.0, 5.0), st.floats(1e-3, 0.05))
def test_from_any_state_it_arrives_without_a_step_and_its_norms_keep_their_limits(
    v: Pair, a: Pair, to: Pair, lim: Limits, later: float, dt: float
) -> None:
    ramp = begun(v, a, to, lim)
    first, second = ramp.at(0.0)
    assert (first.velocity, second.velocity) == pytest.approx(v, abs=1e-8)
    assert (first.acceleration, second.acceleration) == pytest.approx(a, abs=1e-7)
    most, inside = max(lim.acceleration, hypot(*a)), False
    for k in range(60):
        t = ramp.settles() * k / 59
        assert norm(ramp, t, "jerk") <= lim.jerk * (1 + 1e-9)
        now = norm(ramp, t)
        assert now <= (lim.acceleration if inside else most) * (1 + 1e-9)
        inside = inside or now <= lim.acceleration
    first, second = ramp.at(ramp.settles() + 1.0)
    assert (first.velocity, second.velocity) == pytest.approx(to, abs=1e-8)
    assert first.acceleration == second.acceleration == 0.0
    # Its position is what its velocity adds up to, by Simpson's rule over a short time.
    begin, middle, end = (ramp.at(later + share * dt) for share in (0.0, 0.5, 1.0))
    for b, m, e in zip(begin, middle, end, strict=True):
        mean = (b.velocity + 4 * m.velocity + e.velocity) / 6
        assert e.position - b.position == pytest.approx(mean * dt, abs=lim.jerk * dt**3)


@many
@given(pair, st.floats(0.1, 2.0), st.floats(0.0, 2 * pi), st.floats(-3.0, 3.0), limits)
def test_on_one_line_it_is_the_scalar_law(
    v: Pair, e: float, angle: float, a: float, lim: Limits
) -> None:
    n = (cos(angle), sin(angle))
    ramp = begun(v, (a * n[0], a * n[1]), (v[0] + e * n[0], v[1] + e * n[1]), lim)
    scalar = sum(part.duration for part in solve(0.0, a, e, lim))
    assert ramp.settles() == pytest.approx(scalar, rel=1e-5)


@many
@given(pair, pair, limits, st.floats(0.02, 0.98))
def test_from_rest_the_change_is_straight_and_solving_it_again_does_not_delay_it(
    v: Pair, to: Pair, lim: Limits, share: float
) -> None:
    e = to[0] - v[0], to[1] - v[1]
    assume(hypot(*e) > 1e-3)
    ramp = begun(v, (0.0, 0.0), to, lim)
    scalar, total = sum(part.duration for part in solve(0.0, 0.0, hypot(*e), lim)), ramp.settles()
    assert total == pytest.approx(scalar, rel=1e-9)
    here = ramp.at(share * total)
    gained = (here[0].velocity - v[0], here[1].velocity - v[1])
    assert gained[0] * e[1] - gained[1] * e[0] == pytest.approx(0.0, abs=1e-9)
    ramp.aim(to, share * total, lim)
    assert ramp.settles() <= total + 1e-4 * (1 + total)


@many
@given(st.lists(st.tuples(st.floats(0.0, 1.0), pair), min_size=1, max_size=6), limits)
def test_a_ramp_aimed_anew_has_no_step(moves: list[tuple[float, Pair]], lim: Limits) -> None:
    ramp, now = VectorRamp(lim), 0.0
    for wait, target in moves:
        now += wait
        before = ramp.at(now)
        ramp.aim(target, now)
        for b, a in zip(before, ramp.at(now), strict=True):
            assert a[:3] == pytest.approx(b[:3], abs=1e-7)
        assert norm(ramp, now) <= lim.acceleration * (1 + 1e-8)
    end = ramp.at(now + 1e4)
    assert (end[0].velocity, end[1].velocity) == pytest.approx(moves[-1][1], abs=1e-12)


@many
@given(pair, pair, limits, limits, st.floats(0.0, 1.0))
def test_other_limits_count_from_when_they_are_given(
    first: Pair, then: Pair, lim: Limits, other: Limits, when: float
) -> None:
    """For this plan only; told the same again without limits, the ramp goes on as it was."""
    ramp, as_planned = VectorRamp(lim), VectorRamp(lim)
    for each in (ramp, as_planned):
        each.aim(first, 0.0)
    ramp.aim(first, when)
    assert ramp.at(when + 1.0) == as_planned.at(when + 1.0)
    ramp.aim(then, when, other)
    if ramp.settles() > when:
        assert norm(ramp, (when + ramp.settles()) / 2, "jerk") <= other.jerk * (1 + 1e-9)
    assert (ramp.target, ramp.limits) == (then, lim)
