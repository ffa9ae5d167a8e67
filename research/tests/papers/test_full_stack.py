"""Steps flown with and without ramps: only the reference differs, and the scores are right."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lindy.api.messages import topics
from lindy_research.dives import DT, Dive, Floats
from lindy_research.papers.full_stack_energy import PUSHING, Used
from lindy_research.papers.full_stack_runs import NAIVE, AxisLog, StickStep, scores
from lindy_research.papers.identified_battery import hotel_power

pytestmark = pytest.mark.slow

few = settings(max_examples=25, deadline=None)
STICKS = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0.5,0,0.6,0.5\n3,0,0,0,0\n60,0,0,0,0\n"
ON, OFF, END = 1.0, 3.0, 5.0  # [s]
STEP = StickStep(1.0, 4.0, 9.0, 0.02)


@cache
def flown(*, naive: bool) -> Dive:
    return Dive(STICKS, overrides=NAIVE if naive else ()).until(END)


def references(dive: Dive) -> dict[str, Floats]:
    say = dive.column
    return {
        "depth": say(topics.REFERENCE, lambda m: m.depth.position),
        "heave": say(topics.REFERENCE, lambda m: m.depth.velocity),
        "push": say(topics.REFERENCE, lambda m: m.depth.acceleration),
        "heading": say(topics.REFERENCE, lambda m: m.heading.position),
        "yaw": say(topics.REFERENCE, lambda m: m.heading.velocity),
        "turn": say(topics.REFERENCE, lambda m: m.heading.acceleration),
        "surge": say(topics.REFERENCE, lambda m: m.surge_force),
    }


def test_without_ramps_every_reference_jumps_with_the_stick() -> None:
    said, t = references(flown(naive=True)), flown(naive=True).t
    pushed = (t > ON + 0.2) & (t < OFF)
    quiet = (t < ON) | (t > OFF + 0.2)
    for name, size in (("heave", 0.3), ("yaw", 0.525), ("surge", 15.0)):
        assert said[name][pushed] == pytest.approx(size)
        assert said[name][quiet] == pytest.approx(0.0)
        between = (said[name] > 0.01 * size) & (said[name] < 0.99 * size)
        assert np.count_nonzero(between) <= 4  # rows that fall between two samples
    for name in ("push", "turn"):
        assert said[name] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("naive", [True, False])
def test_the_position_is_the_integral_of_the_velocity(*, naive: bool) -> None:
    said = references(flown(naive=naive))
    for position, velocity in (("depth", "heave"), ("heading", "yaw")):
        way = said[position][-1] - said[position][100]
        assert way == pytest.approx(float(np.sum(said[velocity][100:])) * DT, abs=0.01)


def test_with_ramps_they_stay_within_the_vehicle_files_limits() -> None:
    said = references(flown(naive=False))
    assert 0.3 < float(np.max(np.abs(said["push"]))) <= 0.5 + 1e-9  # [m/s²]
    assert 0.3 < float(np.max(np.abs(said["turn"]))) <= 1.5 + 1e-9  # [rad/s²]
    assert float(np.max(np.abs(np.diff(said["surge"])))) <= 40.0 * 1.5 * DT  # [N]


def test_both_ways_meet_the_same_noise_until_the_stick_moves() -> None:
    depth = [
        flown(naive=naive).column(topics.STATE, lambda m: m.depth.value) for naive in (True, False)
    ]
    calm = round((ON - 0.1) / DT)
    assert depth[0][:calm] == pytest.approx(depth[1][:calm], abs=1e-12)
    assert not np.allclose(depth[0][calm:], depth[1][calm:], atol=1e-3)


def column(value: float = 0.0) -> Floats:
    return np.full(round(STEP.end / DT), value)


@few
@given(st.floats(0.001, 0.5), st.floats(-1.0, 1.0), st.floats(1.0, 40.0), st.floats(0.1, 2.0))
def test_a_bump_after_the_release_is_scored_as_what_it_is(
    bump: float, bias: float, force: float, lasts: float
) -> None:
    t = np.arange(len(column())) * DT
    truth = np.where((t >= 4.5) & (t < 4.5 + lasts), 3.0 + bump, 3.0) + bias
    asked = np.where(t >= 2.0, force, 0.0)
    axis = AxisLog(column(3.0), column(), column(2.9), column(), truth, column(), asked, asked)
    found = scores(axis, STEP)
    assert found.overshoot == pytest.approx(bump)
    assert found.error == pytest.approx(bump)  # the constant bias is none
    assert found.left == pytest.approx(0.1)
    assert found.peak == force
    assert found.jerk == pytest.approx((force / DT) ** 2)
    assert found.settled == pytest.approx(0.5 + lasts if bump > STEP.near else 0.0, abs=1.5 * DT)


@few
@given(st.lists(st.floats(0.0, 350.0), min_size=9, max_size=9), st.floats(1.0, 40.0))
def test_energy_is_power_over_time(watts: list[float], seconds: float) -> None:
    power = hotel_power() + np.repeat(watts, round(seconds / 9 / DT) + 970)
    dive = Used(np.arange(0.0, len(power)) * DT, power, power, power)
    assert dive.total == pytest.approx(float(np.sum(power)) * DT)
    assert dive.thrusters[-1] == pytest.approx(dive.total - hotel_power() * len(power) * DT)
    assert 0.0 <= dive.pushing <= dive.thrusters[-1] + 1e-6
    assert PUSHING[-1][1] <= dive.t[-1] + DT
