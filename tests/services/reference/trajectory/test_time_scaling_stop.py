"""An emergency stop of any motion is smooth, within its limits, and its end is known at once."""

from math import inf, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.reference.trajectory.minimum_jerk import Limits, Sample
from services.reference.trajectory.time_scaling import WaitingClock, scaled_sample
from tools.generators.emergency_stop import StoppedMotion, stop, stop_motion
from tools.generators.fernandes import MotionRequest, plan

many = settings(max_examples=100, deadline=None)
limits = st.builds(Limits, st.floats(0.05, 5.0), st.one_of(st.just(inf), st.floats(0.05, 2.0)))
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


def test_a_motion_that_waits_can_be_stopped_too() -> None:
    clock = WaitingClock(0.5, 0.2, Limits(0.3, 0.4))
    clock.watch(1.0, 20.0)

    def waits(t: float) -> Sample:
        here = clock.at(t)
        return scaled_sample(MOTION.at(here.tau), here)

    ending = stop_motion(waits, 21.0, Limits(0.5, 0.3))
    assert ending.at(21.0)[:3] == pytest.approx(waits(21.0)[:3])
    assert ending.at(ending.duration + 1.0).velocity == 0.0


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
