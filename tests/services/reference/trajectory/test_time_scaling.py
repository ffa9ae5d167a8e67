"""A waiting reference stays one consistent smooth motion, stops, resumes, and helps."""

from itertools import pairwise
from math import cos, inf, isclose, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.reference.trajectory.minimum_jerk import Limits, Sample
from services.reference.trajectory.time_scaling import WaitingClock, scaled_sample
from tools.generators.fernandes import MotionRequest, plan

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
def test_the_rate_stays_between_standstill_and_real_time(
    lim: Limits, times: list[tuple[float, float]], later: float
) -> None:
    for t, clock in clocks(lim, times):
        here, after = clock.at(t), clock.at(t + later)
        assert -1e-12 <= after.rate <= 1 + 1e-12
        assert -1e-9 <= after.tau - here.tau <= later + 1e-9
        assert abs(after.rate_change) <= lim.acceleration * (1 + 1e-9)
        assert abs(after.rate_bend) <= lim.jerk * (1 + 1e-9)


@many
@given(limits, episodes)
def test_a_change_of_mind_at_any_time_leaves_no_step(
    lim: Limits, times: list[tuple[float, float]]
) -> None:
    seen = clocks(lim, times)
    for (_, before), (t, after) in pairwise(seen):
        one, two = (scaled_sample(swing(c.at(t).tau), c.at(t)) for c in (before, after))
        assert one[:3] == pytest.approx(two[:3], abs=1e-9)


@many
@given(limits, episodes, st.floats(0.01, 5.0))
def test_velocity_acceleration_and_jerk_are_derivatives(
    lim: Limits, times: list[tuple[float, float]], later: float
) -> None:
    t, clock = clocks(lim, times)[-1]
    h = 1e-5
    one, here, two = (
        scaled_sample(swing(c.tau), c) for c in (clock.at(t + later + d * h) for d in (-1, 0, 1))
    )
    assert (two.position - one.position) / (2 * h) == pytest.approx(here.velocity, abs=1e-8)
    assert (two.velocity - one.velocity) / (2 * h) == pytest.approx(here.acceleration, abs=1e-4)
    # the jerk itself may step where a new piece of the plan begins
    if isclose(clock.at(t + later + h).rate_bend, clock.at(t + later - h).rate_bend, abs_tol=1e-2):
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
    assert clock.at(t + 310.0).tau == pytest.approx(clock.at(t + 300.0).tau + 10.0)


def test_an_error_between_the_two_thresholds_changes_nothing() -> None:
    clock = WaitingClock(0.5, 0.2, Limits(1.0))
    clock.watch(0.45, 3.0)
    assert not clock.waiting
    assert clock.at(9.0) == (9.0, 1.0, 0.0, 0.0)


def test_without_waiting_the_reference_is_untouched() -> None:
    clock = WaitingClock(0.5, 0.2, Limits(1.0), since=2.0)
    assert scaled_sample(swing(clock.at(5.0).tau), clock.at(5.0)) == swing(3.0)


def greatest_error(waits: bool) -> tuple[float, float]:
    """[m] Of a drone with too little thrust, and where it is at the end.

    A 13.3 kg drone (linear drag 6.5 N s/m, 5 N of thrust) follows 50 m at 0.3 m/s with position
    and velocity feedback and feed-forward; from 80 s to 110 s a force of 4 N holds it back.
    """
    motion, clock = (
        plan(MotionRequest(50.0, 0.3, 20.0, 20.0)),
        WaitingClock(0.4, 0.1, Limits(0.5, 0.5)),
    )
    m, d, dt, p, v, greatest = 13.3, 6.5, 0.02, 0.0, 0.0, 0.0
    for k in range(int(300 / dt)):
        t = k * dt
        here = clock.at(t)
        r = scaled_sample(motion.at(here.tau), here)
        e = r.position - p
        greatest = max(greatest, abs(e))
        if waits:
            clock.watch(e, t)
        thrust = 25.5 * e + 23.6 * (r.velocity - v) + d * r.velocity + m * r.acceleration
        held_back = -4.0 if 80.0 <= t < 110.0 else 0.0
        v += (max(-5.0, min(5.0, thrust)) - d * v + held_back) / m * dt
        p += v * dt
    return greatest, p


def test_waiting_keeps_a_drone_that_is_held_back_near_its_reference() -> None:
    runaway, end = greatest_error(waits=False)
    waiting, late_end = greatest_error(waits=True)
    assert runaway > 3.5
    assert waiting < 0.7
    assert (end, late_end) == pytest.approx((50.0, 50.0), abs=0.01)
