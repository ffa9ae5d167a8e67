"""A motion that waits for the vehicle by the pace of its own time."""

from itertools import pairwise
from math import cos, inf, isclose, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.reference.guidance.path_following import WaitingClock, scaled_sample
from services.reference.trajectory.minimum_jerk import Limits, Sample

many = settings(max_examples=80, deadline=None)
limits = st.builds(Limits, st.floats(0.1, 5.0), st.one_of(st.just(inf), st.floats(0.1, 2.0)))
FAR, NEAR = 1.0, 0.0
# what the vehicle does: for how long it is far, then near, again and again
episodes = st.lists(st.tuples(st.floats(0.01, 6.0), st.floats(0.01, 6.0)), max_size=4)


def clocks(lim: Limits, times: list[tuple[float, float]]) -> list[tuple[float, WaitingClock]]:
    """The clock as it is after each change of mind, and when that was."""
    changes, t = list[tuple[float, float]](), 0.0
    for far, near in times:
        changes += [(t + near, FAR), (t + near + far, NEAR)]
        t += near + far
    return [
        (changes[k - 1][0] if k else 0.0, clock_after(changes[:k], lim))
        for k in range(len(changes) + 1)
    ]


def clock_after(changes: list[tuple[float, float]], lim: Limits) -> WaitingClock:
    clock = WaitingClock(0.5, 0.2, lim)
    for t, error in changes:
        clock.watch(error, t)
    return clock


def swing(tau: float) -> Sample:
    """A smooth reference that is never at constant speed."""
    return Sample(sin(tau), cos(tau), -sin(tau), -cos(tau))


@many
@given(limits, episodes, st.floats(0.0, 10.0))
def test_the_rate_stays_between_standstill_and_real_time_and_a_change_of_mind_leaves_no_step(
    lim: Limits, times: list[tuple[float, float]], later: float
) -> None:
    seen = clocks(lim, times)
    for t, clock in seen:
        here, after = clock.at(t), clock.at(t + later)
        assert -1e-12 <= after.velocity <= 1 + 1e-12
        assert -1e-9 <= after.position - here.position <= later + 1e-9
        assert abs(after.acceleration) <= lim.acceleration * (1 + 1e-9)
        assert abs(after.jerk) <= lim.jerk * (1 + 1e-9)
    for (_, before), (t, after) in pairwise(seen):
        one, two = (scaled_sample(swing(c.at(t).position), c.at(t)) for c in (before, after))
        assert one[:3] == pytest.approx(two[:3], abs=1e-9)


@many
@given(limits, episodes, st.floats(0.01, 5.0))
def test_velocity_acceleration_and_jerk_are_derivatives(
    lim: Limits, times: list[tuple[float, float]], later: float
) -> None:
    t, clock = clocks(lim, times)[-1]
    h = 1e-5
    one, here, two = (
        scaled_sample(swing(c.position), c)
        for c in (clock.at(t + later + d * h) for d in (-1, 0, 1))
    )
    assert (two.position - one.position) / (2 * h) == pytest.approx(here.velocity, abs=1e-8)
    assert (two.velocity - one.velocity) / (2 * h) == pytest.approx(here.acceleration, abs=1e-4)
    # the jerk itself may step where a new piece of the plan begins
    if isclose(clock.at(t + later + h).jerk, clock.at(t + later - h).jerk, abs_tol=1e-2):
        assert (two.acceleration - one.acceleration) / (2 * h) == pytest.approx(here.jerk, abs=0.1)


@many
@given(limits, st.floats(0.0, 20.0))
def test_it_stops_completely_while_the_error_stays_and_resumes_afterwards(
    lim: Limits, t: float
) -> None:
    clock = WaitingClock(0.5, 0.2, lim)
    clock.watch(0.6, t)
    stopped = clock.at(t + 100.0)
    assert stopped[1:] == (0.0, 0.0, 0.0)
    clock.watch(0.21, t + 100.0)  # nearer, but not near enough
    assert clock.at(t + 200.0) == stopped
    clock.watch(-0.19, t + 200.0)
    assert clock.at(t + 300.0)[1:] == (1.0, 0.0, 0.0)
    assert clock.at(t + 310.0).position == pytest.approx(clock.at(t + 300.0).position + 10.0)


def test_an_error_between_the_two_thresholds_changes_nothing() -> None:
    clock = WaitingClock(0.5, 0.2, Limits(1.0), since=2.0)
    clock.watch(0.45, 3.0)
    assert not clock.waiting
    assert scaled_sample(swing(clock.at(9.0).position), clock.at(9.0)) == swing(7.0)
