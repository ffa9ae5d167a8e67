"""What a release is judged by, on motions that are known."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lindy_research.ardusub_comparison.releases import TrueMotion, judge, judge_turn, swayed
from lindy_research.ardusub_comparison.sticks import DEEP, KINDS, drawn, judged, sticks_at


def stopped(at: float, way: float, back: float, direction: float, begin: float) -> TrueMotion:
    """1 m/s until `at`; then `way` on within a second, and `back` within the next."""
    t = np.arange(at - 3.0, at + 12.0, 0.002)
    after = t - at
    travelled = np.interp(after, [-3.0, 0.0, 1.0, 2.0], [-3.0, 0.0, way, way - back])
    depth = begin + direction * travelled
    still = np.zeros_like(t)
    return TrueMotion(t, np.round(depth, 2), np.gradient(depth, t), *[still] * 4)


@given(
    st.floats(0.1, 2.0),
    st.floats(0.0, 0.1),
    st.sampled_from([-1.0, 1.0]),
    st.floats(3.0, 9.0),
    st.floats(0.0, 1e4),
)
def test_a_stop_that_is_known_is_found_whichever_way_it_went(
    way: float, back: float, direction: float, begin: float, at: float
) -> None:
    found = judge(stopped(at, way, back, direction, begin), at, direction)
    assert found.stopping == pytest.approx(way, abs=0.004)
    assert found.bounce == pytest.approx(back, abs=0.004)
    assert found.speed == pytest.approx(1.0, rel=0.01)
    assert found.doubt < 0.015
    assert found.short == pytest.approx(0.0, abs=0.004)
    assert found.rms == pytest.approx(0.0, abs=1e-4)
    assert found.sinking == (direction > 0.0)


def test_rms_at_rest_is_about_the_mean() -> None:
    truth = stopped(10.0, 0.5, 0.0, 1.0, 5.0)
    swing = 0.01 * 2 * np.pi * np.cos(2 * np.pi * truth.t)  # [m/s] of 10 mm
    swing = truth._replace(speed=truth.speed + swing)
    assert judge(swing, 10.0, 1.0).short == pytest.approx(0.01, abs=0.002)
    assert judge(swing, 10.0, 1.0).rms == pytest.approx(0.01 / np.sqrt(2), rel=0.02)


def test_a_release_that_was_not_recorded_is_said() -> None:
    with pytest.raises(ValueError, match="not covered"):
        judge(stopped(10.0, 0.5, 0.0, 1.0, 5.0), 20.0, 1.0)


def test_a_turn_is_judged_as_a_dive_is() -> None:
    truth = stopped(10.0, 0.5, 0.04, -1.0, 0.0)
    turned = truth._replace(heading=truth.depth, speed=0.0 * truth.t)
    assert judge_turn(turned, 10.0, -1.0).bounce == pytest.approx(0.04, abs=0.011)


@given(st.sampled_from([-1.0, 1.0]), st.floats(0.01, 0.1))
def test_a_drone_that_bobs_when_surge_is_let_go_is_seen_either_way(
    direction: float, way: float
) -> None:
    truth = stopped(10.0, way, way, direction, 5.0)
    truth = truth._replace(speed=np.where(truth.t < 10.0, 0.0, truth.speed))
    assert swayed(truth, 10.0) == pytest.approx(way, abs=0.004)


def test_judged_sticks_are_full_and_go_each_way_as_often() -> None:
    sticks = judged()
    assert {abs(move.heave) for move in sticks} == {0.0, 1.0}
    assert sticks_at(sticks, -1.0).heave == sticks_at(sticks, sticks[-1].at).heave == 0.0
    down = sum(move.heave > 0.0 for move in sticks[3:])
    assert sum(move.heave < 0.0 for move in sticks) == down == 4


@given(st.integers(0, 10**6), st.integers(1, 4))
def test_drawn_sticks_let_each_kind_go_as_often_and_keep_the_drone_under_water(
    seed: int, rounds: int
) -> None:
    moves = drawn(seed, rounds)
    kept = sum(bool(kept) for _, kept in KINDS)
    let_go = sum(any(a[1:]) and not any(b[1:]) for a, b in pairwise(moves))
    changed = sum(any(a[1:]) and any(b[1:]) for a, b in pairwise(moves))
    assert (let_go, changed) == (1 + rounds * len(KINDS), rounds * kept)
    depth = 0.0
    for move, after in pairwise(moves):
        depth += 0.97 * move.heave * (after.at - move.at)
        assert 0.0 <= depth < DEEP
    assert drawn(seed, rounds) == moves
    assert drawn(seed + 1, rounds) != moves
