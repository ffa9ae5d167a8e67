"""A motion that waits for the vehicle, or stops on the way, by the pace of its own time."""

from itertools import pairwise
from math import cos, inf, isclose, nan, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.reference.trajectory.minimum_jerk import Limits, Sample
from services.reference.trajectory.time_scaling import WaitingClock, scaled_sample
from tools.generators.emergency_stop import StoppedMotion, stop, stop_motion
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
        assert -1e-12 <= after.velocity <= 1 + 1e-12
        assert -1e-9 <= after.position - here.position <= later + 1e-9
        assert abs(after.acceleration) <= lim.acceleration * (1 + 1e-9)
        assert abs(after.jerk) <= lim.jerk * (1 + 1e-9)


@many
@given(limits, episodes)
def test_a_change_of_mind_at_any_time_leaves_no_step(
    lim: Limits, times: list[tuple[float, float]]
) -> None:
    seen = clocks(lim, times)
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
    clock = WaitingClock(0.5, 0.2, Limits(1.0))
    clock.watch(0.45, 3.0)
    assert not clock.waiting
    assert clock.at(9.0) == (9.0, 1.0, 0.0, 0.0)


def test_without_waiting_the_reference_is_untouched() -> None:
    clock = WaitingClock(0.5, 0.2, Limits(1.0), since=2.0)
    assert scaled_sample(swing(clock.at(5.0).position), clock.at(5.0)) == swing(3.0)


MOTION = plan(MotionRequest(-50.0, 0.8, 10.0, 6.0, 0.2, 0.3))


def stop_distance(ending: StoppedMotion) -> float:
    """Displacement from the beginning of the stop to standstill, negative when backwards."""
    return ending.at(ending.duration).position - ending.position


@many
@given(st.floats(-0.1, 1.2), limits)
def test_it_goes_on_without_a_step_and_comes_to_rest(share: float, lim: Limits) -> None:
    t = share * MOTION.duration
    ending = stop(MOTION, t, lim)
    assert ending.at(t)[:3] == pytest.approx(MOTION.at(t)[:3], abs=1e-12)
    assert ending.at(t - 0.5) == MOTION.at(t - 0.5)
    end = ending.at(ending.duration + 60.0)
    assert end[1:] == (0.0, 0.0, 0.0)
    assert end.position == pytest.approx(MOTION.at(t).position + stop_distance(ending), abs=1e-12)
    just_before = ending.at(ending.duration - 1e-9)
    assert just_before.velocity == pytest.approx(0.0, abs=1e-9)
    assert just_before.acceleration == pytest.approx(0.0, abs=1e-7)


@many
@given(st.floats(0.0, 1.0), limits, st.floats(0.0, 1.0))
def test_it_stays_within_its_limits_and_goes_no_farther_than_it_says(
    share: float, lim: Limits, later: float
) -> None:
    t = share * MOTION.duration
    ending, began = stop(MOTION, t, lim), MOTION.at(t)
    assert len(ending.segments) <= 4
    here = ending.at(t + later * ending.stop_time)
    assert abs(here.jerk) <= lim.jerk * (1 + 1e-9)
    most = max(lim.acceleration, abs(began.acceleration))
    assert abs(here.acceleration) <= most * (1 + 1e-9)
    if began.acceleration**2 <= 2 * lim.jerk * abs(began.velocity):  # else it must overshoot
        assert stop_distance(ending) - 1e-9 <= here.position - began.position <= 1e-9


@pytest.mark.parametrize(
    ("v", "a", "lim", "time", "distance", "segments"),
    [
        (0.3, 0.0, Limits(1.0), 1.3416407864998738, 0.20124611797498107, 1),
        (0.3, 0.0, Limits(1.0, 0.15), 2.2, 0.33, 3),
        (1.0, 0.2, Limits(1.5, 0.4), 3.022222222222222, 1.5982222222222224, 4),
        (1.5, -0.1, Limits(2.0, 0.5), 3.2859236254666553, 2.4292465493110944, 3),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_time_and_distance_it_needs(
    v: float, a: float, lim: Limits, time: float, distance: float, segments: int, sign: float
) -> None:
    ending = stop_motion(lambda _: Sample(sign * 7.0, sign * v, sign * a, 0.0), 5.0, lim)
    assert ending.stop_time == pytest.approx(time, abs=1e-9)
    assert ending.duration == pytest.approx(5.0 + time, abs=1e-9)
    assert stop_distance(ending) == pytest.approx(sign * distance, abs=1e-9)
    assert ending.at(99.0).position == pytest.approx(sign * (7.0 + distance), abs=1e-9)
    assert len(ending.segments) == segments


def test_a_motion_at_rest_is_stopped_where_it_is() -> None:
    ending = stop(plan(MotionRequest(5.0, 0.5, 5.0, 5.0)), 1000.0, Limits(1.0))
    assert (ending.stop_time, stop_distance(ending)) == (0.0, 0.0)
    assert ending.at(2000.0) == (5.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("t", "lim", "says"),
    [
        (1.0, Limits(0.0), "jerk of a stop is 0.0"),
        (1.0, Limits(nan), "jerk of a stop is nan"),
        (1.0, Limits(inf), "jerk of a stop is inf"),
        (1.0, Limits(1.0, 0.0), "acceleration of a stop is 0.0"),
        (1.0, Limits(1.0, nan), "acceleration of a stop is nan"),
        (nan, Limits(1.0), "time of a stop is nan"),
    ],
)
def test_a_stop_that_makes_no_sense_is_refused(t: float, lim: Limits, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        stop(MOTION, t, lim)


def test_a_motion_that_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="not finite at 3 s"):
        stop_motion(lambda t: Sample(t, nan, 0.0, 0.0), 3.0, Limits(1.0))
