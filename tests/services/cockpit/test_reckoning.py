"""Dead reckoning on the map, in whole dives of drones that do not measure their position: the true
place is where the spread says, in a current that nobody measures."""

import random
from bisect import bisect_right
from itertools import pairwise
from math import cos, dist, pi, sin

import pytest

from services.cockpit.chart import Chart
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from tests.support.sortie import Sortie, SortieRow

FASTEST = 0.3  # [m/s] of the current
FLOWN_S = 45.0
STEP_NS = 40_000_000
OVERRIDES = ("simulator.floor_depth=60", "simulator.current.std=0.02")


def errors(vehicle: str, seed: int) -> list[tuple[float, float]]:
    """[m] Of the chart and the spread that it says, once a second after arming."""
    rng = random.Random(seed)
    speed, course = rng.uniform(0.0, FASTEST), rng.uniform(-pi, pi)
    current = (
        f"simulator.current.north={speed * cos(course)}",
        f"simulator.current.east={speed * sin(course)}",
    )
    hands: list[SortieRow] = [(0.5, (0.0, 0.0, 1.0, 0.0))]
    for k in range(1, 9):
        surge, sway, heave, yaw = (rng.uniform(-1.0, 1.0) for _ in range(4))
        hands.append((1.0 + 5.0 * k, (surge, 0.5 * sway, 0.2 * heave, 0.4 * yaw)))
    flown = Sortie(hands, vehicle=vehicle, seed=seed, overrides=(*OVERRIDES, *current))
    begin_ns = flown.states[-1].stamp_ns
    flown.until(FLOWN_S)
    chart = Chart(Stack(vehicle=vehicle).section("vehicle", Vehicle))
    states, wrenches, truth = flown.states, flown.wrenches, flown.truth
    seen_at, pushed_at = [m.stamp_ns for m in states], [m.stamp_ns for m in wrenches]
    true_at = [m.stamp_ns for m in truth]
    start = truth[bisect_right(true_at, begin_ns) - 1].position[:2]
    found: list[tuple[float, float]] = []
    for now in range(begin_ns, states[-1].stamp_ns, STEP_NS):
        state, k = states[bisect_right(seen_at, now) - 1], bisect_right(pushed_at, now)
        chart.step(state, wrenches[k - 1] if k else None, now, armed=True)
        if (now - begin_ns) % 1_000_000_000 < STEP_NS and now > begin_ns:
            assert chart.here is not None
            assert not chart.here.measured
            north, east, _ = truth[bisect_right(true_at, now) - 1].position
            place = chart.here.north, chart.here.east
            found.append((dist(place, (north - start[0], east - start[1])), chart.here.std))
    return found


def share(vehicle: str, seeds: range) -> float:
    """[-] of the dives in which the true place is within two standard deviations all the time."""
    dives = [errors(vehicle, seed) for seed in seeds]
    for dive in dives:
        assert all(b[1] >= a[1] for a, b in pairwise(dive))
        assert dive[-1][1] < FASTEST * FLOWN_S  # and it does say something
    within = [all(error <= 2.0 * std + 0.05 for error, std in dive) for dive in dives]
    return sum(within) / len(within)


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["pioneer", "bluerov2_heavy"])
def test_the_true_place_is_within_two_standard_deviations(vehicle: str) -> None:
    assert share(vehicle, range(5)) >= 0.8


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["pioneer", "bluerov2_heavy"])
def test_in_nine_of_ten_dives_the_true_place_is_within_two_standard_deviations(
    vehicle: str,
) -> None:
    assert share(vehicle, range(20)) >= 0.9
