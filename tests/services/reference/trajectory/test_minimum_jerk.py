"""The law of the jerk-bounded minimum-jerk velocity reference."""

from math import inf, isclose, sqrt

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from services.reference.trajectory.minimum_jerk import (
    Limits,
    Ramp,
    Sample,
    Segment,
    along,
    reader,
    solve,
)

velocity = st.floats(-3.0, 3.0)
acceleration = st.floats(-4.0, 4.0)
limits = st.builds(Limits, st.floats(0.1, 20.0), st.one_of(st.just(inf), st.floats(0.05, 5.0)))
many = settings(max_examples=300, deadline=None)


def duration(segments: list[Segment]) -> float:
    return sum(segment.duration for segment in segments)


def ramp_from(v: float, a: float, target: float, lim: Limits) -> Ramp:
    return Ramp(lim, position=0.0, target=target, segments=tuple(solve(v, a, target, lim)))


@many
@given(velocity, acceleration, velocity, limits)
def test_every_transition_is_continuous_within_its_limits_and_arrives_at_rest(
    v: float, a: float, target: float, lim: Limits
) -> None:
    here_v, here_a = v, a
    segments = solve(v, a, target, lim)
    for segment in segments:
        assert segment.duration > 0
        assert segment.v0 == pytest.approx(here_v, abs=1e-9)
        assert segment.a0 == pytest.approx(here_a, abs=1e-6)
        for t in (0.0, segment.duration):  # jerk is linear: its extremes are at the ends
            assert abs(segment.at(t).jerk) <= lim.jerk * (1 + 1e-9)
        for k in range(11):  # never above the limit, or where it started
            now = segment.at(segment.duration * k / 10)
            assert abs(now.acceleration) <= max(lim.acceleration, abs(a)) * (1 + 1e-9) + 1e-9
        _, here_v, here_a, _ = segment.at(segment.duration)
    assert len(segments) <= 4
    if segments:
        assert (here_v, here_a) == (
            pytest.approx(target, abs=1e-9), pytest.approx(0.0, abs=1e-6)
        )  # fmt: skip


@many
@given(velocity, acceleration, velocity, limits, st.floats(0.01, 0.99))
def test_solving_again_on_the_way_changes_nothing(
    v: float, a: float, target: float, lim: Limits, share: float
) -> None:
    """Property 1 of the thesis, for the bounded law."""
    first = ramp_from(v, a, target, lim)
    total = duration(list(first.segments))
    assume(total > 1e-3)
    here = first.at(share * total)
    rest = solve(here.velocity, here.acceleration, target, lim)
    # Where a rounding error of the state decides between branches, the durations still agree.
    assert duration(rest) == pytest.approx((1 - share) * total, abs=1e-6 * (1 + total))


@many
@given(velocity, acceleration, velocity, limits)
def test_the_duration_is_continuous_in_the_state(
    v: float, a: float, target: float, lim: Limits
) -> None:
    """The thesis' rule jumps by a factor 2.4 at a² = 6 J e; the bounded law must not."""
    step = 1e-9
    near = duration(solve(v + step, a, target, lim))
    assert near == pytest.approx(duration(solve(v, a, target, lim)), abs=1e-3)


@given(st.floats(0.01, 3.0), st.floats(0.1, 20.0))
def test_from_rest_it_is_the_thesis_closed_form(e: float, jerk: float) -> None:
    (segment,) = solve(0.0, 0.0, e, Limits(jerk))
    assert segment.duration == pytest.approx(sqrt(6 * e / jerk))
    half = segment.at(segment.duration / 2)
    assert half.acceleration == pytest.approx(sqrt(6 * e * jerk) / 4)
    assert segment.at(segment.duration).position == pytest.approx(e * segment.duration / 2)


# Andrén's rule and the bounded law, computed with 40 digits: v1, a1, v2, J, a_max → T, distance.
GOLDEN = [
    (0.2, -0.5, 0.8, 2.0, inf, 1.6597872180, 0.7004210918),
    (0.0, 1.5, 1.0, 1.0, inf, 2.3660254038, 2.0451519915),
    (0.0, 2.0, 0.5, 1.0, inf, 5.0, 6.4166666667),
    (-0.3, 0.6, -0.9, 2.5, 0.7, 1.5733333333, -0.81248),
    (0.0, 0.0, 2.0, 1.0, 0.5, 4.6666666667, 4.6666666667),
    (0.5, -0.3, 2.0, 1.0, 0.5, 4.0566666667, 4.7523083333),
    (0.0, 0.45, 0.05, 1.0, 0.5, 1.0045268253, 0.0723110912),
    (0.0, 0.8, 2.0, 1.0, 0.5, 4.2433333333, 4.6462527778),
]


@pytest.mark.parametrize(("v1", "a1", "v2", "jerk", "peak", "total", "distance"), GOLDEN)
def test_known_transitions(
    v1: float, a1: float, v2: float, jerk: float, peak: float, total: float, distance: float
) -> None:
    ramp = ramp_from(v1, a1, v2, Limits(jerk, peak))
    assert duration(list(ramp.segments)) == pytest.approx(total, rel=1e-9)
    assert ramp.at(total).position == pytest.approx(distance, rel=1e-9)


sample = st.builds(Sample, velocity, velocity, acceleration, st.just(0.0))
ORDERS = ("aim", "brake", "brake so", "limit", "take", "rest", "shift")


@given(
    limits,
    limits,
    st.lists(
        st.tuples(st.sampled_from(ORDERS), velocity, sample, st.floats(0.0, 2.0)),
        min_size=1,
        max_size=6,
    ),
)
def test_whatever_is_ordered_it_goes_on_from_where_it_is_and_comes_to_what_was_ordered(
    own: Limits, other: Limits, orders: list[tuple[str, float, Sample, float]]
) -> None:
    """Every plan arrives with the jerk in force, and no jerk in it is higher."""
    ramp, now, target = Ramp(own), 0.0, 0.0
    for order, number, elsewhere, wait in orders:
        now += wait
        here = ramp.at(now)
        match order:
            case "aim":
                ramp.aim(number, now)
                target = number
            case "limit":
                ramp.take(ramp.at(now), now, ramp.target, other)
            case "take":
                ramp.take(elsewhere, now)
                here, target = elsewhere, 0.0
            case "rest":
                ramp.rest(number, now)
                here, target = Sample(number, 0.0, 0.0, 0.0), 0.0
            case "shift":
                ramp.shift(number)
                here = here._replace(position=here.position + number)
            case _:
                ramp.brake(now, other if order == "brake so" else None)
                target = 0.0
        end = max(now, ramp.settles())
        there = ramp.at(end)
        assert there[1:3] == pytest.approx((target, 0.0), abs=1e-5)
        assert ramp.to_go(now) == pytest.approx(there.position - ramp.at(now).position)
        assert ramp.to_go(end + 1.0) == 0.0
        assert ramp.at(end + 2.0)[1:] == (target, 0.0, 0.0)
        assert ramp.at(end + 2.0).position == pytest.approx(there.position + 2 * target, abs=1e-5)
        assert ramp.at(now)[:3] == pytest.approx(here[:3], abs=1e-6)  # however often it is asked
        jerks = [part.at(t).jerk for part in ramp.segments for t in (0.0, part.duration)]
        assert all(abs(jerk) <= ramp.in_force.jerk * (1 + 1e-9) for jerk in jerks)
        if duration(list(ramp.segments)) > 1e-3:
            assert abs(jerks[-1]) == pytest.approx(ramp.in_force.jerk)


# Andrén's rule, begun elsewhere: v, a, limits → time and distance to rest, number of segments.


@many
@given(velocity, acceleration, velocity, limits, st.floats(0.0, 1.5))
def test_a_plan_read_in_any_way_is_the_same_motion_whose_quantities_fit_together(
    v: float, a: float, target: float, lim: Limits, share: float
) -> None:
    segments, h = solve(v, a, target, lim), 1e-5
    t = share * (1.0 + duration(segments))
    read, found = reader(segments, target), along(segments, t, target)
    assert found[:3] == pytest.approx(read(t)[:3], rel=1e-9, abs=1e-9)
    before, here, after = (read(t + k * h) for k in (0, 1, 2))
    assert isclose((after[0] - before[0]) / (2 * h), here[1], abs_tol=1e-4)
    assert isclose((after[1] - before[1]) / (2 * h), here[2], abs_tol=1e-2 * lim.jerk)


@many
@given(velocity, limits, st.floats(0.0, 2.0), st.floats(0.0, 5.0))
def test_segments_from_elsewhere_are_run_from_where_it_is_and_end_at_rest(
    target: float, other: Limits, when: float, later: float
) -> None:
    ramp = Ramp(Limits(1.0, 0.5))
    ramp.aim(target, 0.0)
    here = ramp.at(when)
    segments = solve(here.velocity, here.acceleration, 0.0, other)
    ramp.run(segments, when)
    x, v, a, _ = along(segments, later, 0.0)
    assert ramp.at(when + later)[:3] == pytest.approx((here.position + x, v, a), abs=1e-6)
    assert ramp.at(ramp.settles() + 1.0).velocity == 0.0
