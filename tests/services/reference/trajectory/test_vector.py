"""Velocity vectors change straight, within norm limits, in whatever frame."""

from math import cos, hypot, inf, pi, sin

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from services.reference.trajectory.minimum_jerk import Limits, Sample, solve
from services.reference.trajectory.vector import (
    Stage,
    Vector,
    VectorRamp,
    bounded_plan,
)

number = st.floats(-2.0, 2.0)
pair = st.tuples(number, number)
triple = st.tuples(number, number, number)
state = st.one_of(st.tuples(pair, pair, pair), st.tuples(triple, triple, triple))
limits = st.builds(Limits, st.floats(0.2, 10.0), st.one_of(st.just(inf), st.floats(0.1, 3.0)))
many = settings(max_examples=200, deadline=None)
few = settings(max_examples=50, deadline=None)
State = tuple[Vector, Vector, Vector]


def length(stages: list[Stage]) -> float:
    return sum(stage[0].duration for stage in stages)


def norm_at(stage: Stage, share: float, what: str) -> float:
    return hypot(*(getattr(s.at(share * s.duration), what) for s in stage))


def difference(p: Vector, q: Vector) -> Vector:
    return tuple(x - y for x, y in zip(p, q, strict=True))


def turned(p: Vector, angle: float) -> Vector:
    return (p[0] * cos(angle) - p[1] * sin(angle), p[0] * sin(angle) + p[1] * cos(angle))


@many
@given(state, limits)
def test_norms_keep_their_limits_from_any_state(s: State, lim: Limits) -> None:
    most = max(lim.acceleration, hypot(*s[1]))
    inside = False
    for stage in bounded_plan(*s, lim):
        for k in range(9):
            assert norm_at(stage, k / 8, "jerk") <= lim.jerk * (1 + 1e-9)
            a = norm_at(stage, k / 8, "acceleration")
            assert a <= (lim.acceleration if inside else most) * (1 + 1e-9)
            inside = inside or a <= lim.acceleration


@many
@given(state, limits)
def test_velocity_and_acceleration_are_continuous_and_arrive(s: State, lim: Limits) -> None:
    v, a, target = s
    for stage in bounded_plan(*s, lim):
        assert tuple(part.v0 for part in stage) == pytest.approx(v, abs=1e-8)
        assert tuple(part.a0 for part in stage) == pytest.approx(a, abs=1e-9)
        end = [part.at(part.duration) for part in stage]
        v, a = tuple(e.velocity for e in end), tuple(e.acceleration for e in end)
    if v != target:
        assert v == pytest.approx(target, abs=1e-8)
        assert hypot(*a) < 1e-6


# Some times of turning are too short for the jerk, although shorter ones are not.
TORN: list[tuple[State, float]] = [
    (((0.9585809388672066, 0.02314211079194184), (2.5980041488621035, -1.7622242476594747),
      (1.971521498548109, -0.5362518270904717)), 2.847017035495802),
    (((0.6133603133149768, 0.8130967567251464), (2.3518389082659708, 1.4600890354002276),
      (1.7351487683881985, 1.561827137834114)), 1.7785539938136719),
]  # fmt: skip


@pytest.mark.parametrize(("s", "jerk"), TORN)
def test_the_search_takes_no_turning_that_the_jerk_cannot_make(s: State, jerk: float) -> None:
    v = s[0]
    for stage in bounded_plan(*s, Limits(jerk)):
        assert tuple(part.v0 for part in stage) == pytest.approx(v, abs=1e-9)
        v = tuple(part.at(part.duration).velocity for part in stage)


@many
@given(pair, pair, limits, st.floats(0.0, 1.0))
def test_from_rest_the_change_is_straight_and_the_scalar_law(
    v: Vector, target: Vector, lim: Limits, share: float
) -> None:
    e = difference(target, v)
    assume(hypot(*e) > 1e-3)
    stages = bounded_plan(v, (0.0, 0.0), target, lim)
    assert length(stages) == pytest.approx(
        sum(part.duration for part in solve(0.0, 0.0, hypot(*e), lim)), rel=1e-9
    )
    ramp = VectorRamp(lim, (0.0, 0.0), target, stages=tuple(stages))
    here = ramp.at(share * length(stages))
    gained = (here[0].velocity - v[0], here[1].velocity - v[1])
    assert gained[0] * e[1] - gained[1] * e[0] == pytest.approx(0.0, abs=1e-9)


@many
@given(pair, st.floats(0.1, 2.0), st.floats(0.0, 2 * pi), st.floats(-3.0, 3.0), limits)
def test_on_one_line_it_is_the_scalar_law(
    v: Vector, e: float, angle: float, a: float, lim: Limits
) -> None:
    n = (cos(angle), sin(angle))
    target = (v[0] + e * n[0], v[1] + e * n[1])
    found = length(bounded_plan(v, (a * n[0], a * n[1]), target, lim))
    assert found == pytest.approx(sum(p.duration for p in solve(0.0, a, e, lim)), rel=1e-5)


@many
@given(pair, pair, pair, limits, st.floats(0.0, 2 * pi))
def test_turning_the_frame_changes_nothing(
    v: Vector, a: Vector, target: Vector, lim: Limits, angle: float
) -> None:
    there = turned(v, angle), turned(a, angle), turned(target, angle)
    here = length(bounded_plan(v, a, target, lim))
    assert length(bounded_plan(*there, lim)) == pytest.approx(here, rel=1e-5, abs=1e-6)


def total_with(turning: float, a: Vector, e: Vector, lim: Limits) -> float:
    """[s] Until arrival, if constant jerk for `turning` leaves a straight line; inf: it cannot."""
    before, left = np.array(a), np.array(e) - np.array(a) * turning / 2
    if not left.any():
        return inf
    line = left / np.linalg.norm(left)
    along = float(before @ line)
    room = (lim.jerk * turning) ** 2 - (float(before @ before) - along**2)
    if room < 0.0:
        return inf
    after = along - min(max(along, -(room**0.5)), room**0.5)  # as near to zero as the jerk brings
    rest = float((left - after * line * turning / 2) @ line)
    return turning + sum(part.duration for part in solve(0.0, after, rest, lim))


# The change of velocity in units of |a|²/J, and its angle to the acceleration. With the second
# ones the acceleration is too high by so little that neither the quickest nor the longest turning
# is the best.
anywhere = st.tuples(st.floats(0.03, 10.0), st.floats(-pi, pi))
nearly_there = st.tuples(st.floats(0.47, 0.82), st.floats(0.05, 0.47))


@given(st.floats(0.2, 2.0), anywhere | nearly_there | nearly_there, limits)
def test_no_other_turning_arrives_sooner(
    a: float, change: tuple[float, float], lim: Limits
) -> None:
    assume(a <= lim.acceleration)
    size, angle = change[0] * a * a / lim.jerk, change[1]
    e = (size * cos(angle), size * sin(angle))
    found = length(bounded_plan((0.0, 0.0), (a, 0.0), e, lim))
    others = (total_with(k / 20 * a / lim.jerk, (a, 0.0), e, lim) for k in range(1, 21))
    assert found <= min(others) * (1 + 1e-6)


def scaled(p: Vector, by: float) -> Vector:
    return tuple(by * x for x in p)


@few
@given(state, limits, st.floats(0.1, 10.0) | st.floats(-10.0, -0.1), st.floats(0.1, 10.0))
def test_neither_units_nor_direction_matter(
    s: State, lim: Limits, unit: float, faster: float
) -> None:
    """The same change in other units, mirrored, and with the time run faster."""
    v, a, target = (scaled(p, unit * faster**n) for p, n in zip(s, (1, 2, 1), strict=True))
    there = Limits(lim.jerk * abs(unit) * faster**3, lim.acceleration * abs(unit) * faster**2)
    here = length(bounded_plan(*s, lim))
    assert length(bounded_plan(v, a, target, there)) * faster == pytest.approx(here, rel=1e-5)


@few
@given(state, limits)
def test_who_is_there_already_has_nothing_to_do(s: State, lim: Limits) -> None:
    rest = (0.0,) * len(s[0])
    assert bounded_plan(s[0], rest, s[0], lim) == []


@few
@given(state, limits, st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(1e-3, 0.05))
def test_position_is_what_the_velocity_adds_up_to(
    s: State, lim: Limits, since: float, later: float, dt: float
) -> None:
    """By Simpson's rule over a short time, in mid-transition and after it; velocity likewise."""
    place = tuple(3.0 * x for x in s[1])
    stages = tuple(bounded_plan(*s, lim))
    ramp = VectorRamp(lim, place, s[2], since, stages)
    assume(all(abs(later - end) > dt for end in np.cumsum([part[0].duration for part in stages])))
    if stages:
        assert tuple(x.position for x in ramp.at(since)) == pytest.approx(place)
    for begin, middle, end in zip(
        *(ramp.at(since + later + share * dt) for share in (0.0, 0.5, 1.0)), strict=True
    ):
        for k in (0, 1):
            mean = (begin[k + 1] + 4 * middle[k + 1] + end[k + 1]) / 6
            assert end[k] - begin[k] == pytest.approx(mean * dt, abs=1e-7)


@few
@given(pair, pair | st.none(), limits, limits, st.floats(0.0, 1.0))
def test_other_limits_count_from_when_they_are_given(
    first: Vector, other_target: Vector | None, lim: Limits, other: Limits, when: float
) -> None:
    """For this plan only, and also if the target is the same; told that again without limits, the
    ramp goes on as it was."""
    target = other_target or first
    ramp, as_planned = (VectorRamp(lim, (0.0, 0.0), (0.0, 0.0)) for _ in range(2))
    for each in (ramp, as_planned):
        each.aim(first, 0.0)
    ramp.aim(first, when)
    assert ramp == as_planned
    here = ramp.at(when)
    ramp.aim(target, when, other)
    v, a = tuple(s.velocity for s in here), tuple(s.acceleration for s in here)
    assert ramp.stages == tuple(bounded_plan(v, a, target, other))
    assert (ramp.target, ramp.since) == (target, when)
    assert ramp.limits == lim


@many
@given(state, limits, st.floats(0.02, 0.98))
def test_solving_again_on_the_way_never_delays_the_arrival(
    s: State, lim: Limits, share: float
) -> None:
    stages = bounded_plan(*s, lim)
    total = length(stages)
    assume(total > 1e-2)
    ramp = VectorRamp(lim, (0.0,) * len(s[0]), s[2], stages=tuple(stages))
    here = ramp.at(share * total)
    v, a = tuple(h.velocity for h in here), tuple(h.acceleration for h in here)
    assert length(bounded_plan(v, a, s[2], lim)) <= (1 - share) * total + 1e-5 * (1 + total)


@many
@given(st.lists(st.tuples(st.floats(0.0, 1.0), pair), min_size=1, max_size=6), limits)
def test_a_ramp_aimed_anew_has_no_step(moves: list[tuple[float, Vector]], lim: Limits) -> None:
    ramp, now = VectorRamp(lim, (0.0, 0.0), (0.0, 0.0)), 0.0
    for wait, target in moves:
        now += wait
        before = ramp.at(now)
        ramp.aim(target, now)
        for b, a in zip(before, ramp.at(now), strict=True):
            assert a[:3] == pytest.approx(b[:3], abs=1e-8)
        assert norm(ramp, now) <= lim.acceleration * (1 + 1e-9)
    end = ramp.at(now + 1e4)
    assert (end[0].velocity, end[1].velocity) == moves[-1][1]


@many
@given(pair, limits, st.floats(0.0, 2.0), st.floats(0.0, 10.0))
def test_put_to_rest_it_stands_still_whatever_was_before(
    target: Vector, lim: Limits, when: float, later: float
) -> None:
    ramp = VectorRamp(lim, (0.0, 0.0), (0.0, 0.0))
    ramp.aim(target, 0.0)
    ramp.rest(when)
    assert ramp.at(when + later) == (Sample(0.0, 0.0, 0.0, 0.0),) * 2


def norm(ramp: VectorRamp, t: float) -> float:
    return hypot(*(axis.acceleration for axis in ramp.at(t)))


not_finite = st.sampled_from([inf, -inf, float("nan")])


@few
@given(state, st.integers(0, 2), st.integers(0, 1), not_finite)
def test_a_number_that_is_not_finite_is_refused_wherever_it_is(
    s: State, which: int, axis: int, bad: float
) -> None:
    found = [list(part) for part in s]
    found[which][axis] = bad
    v, a, target = map(tuple, found)
    with pytest.raises(ValueError, match="finite"):
        bounded_plan(v, a, target, Limits(1.0))


def test_wrong_vectors_are_refused() -> None:
    with pytest.raises(ValueError, match="one number per axis"):
        bounded_plan((0.0,), (0.0, 0.0), (1.0,), Limits(1.0))
    with pytest.raises(ValueError, match="finite"):
        bounded_plan((0.0,), (inf,), (1.0,), Limits(1.0))
    with pytest.raises(ValueError, match="above 0"):
        bounded_plan((0.0,), (0.0,), (1.0,), Limits(0.0))
    with pytest.raises(ValueError, match="found 1, 1 and 2"):
        bounded_plan((0.0,), (0.0,), (1.0, 1.0), Limits(1.0))
    with pytest.raises(ValueError, match="found 2, 1 and 1"):
        bounded_plan((0.0, 0.0), (0.0,), (1.0,), Limits(1.0))
    with pytest.raises(ValueError, match="found 0, 0 and 0"):
        bounded_plan((), (), (), Limits(1.0))


hundredths = st.integers(-100, 100).map(lambda k: k / 100)


@given(hundredths, hundredths)
def test_only_limits_above_zero_are_taken(jerk: float, acceleration: float) -> None:
    there = Limits(jerk, acceleration)
    if jerk > 0.0 and acceleration > 0.0:
        assert bounded_plan((0.0,), (0.0,), (1.0,), there)
        return
    with pytest.raises(ValueError, match="above 0"):
        bounded_plan((0.0,), (0.0,), (1.0,), there)
