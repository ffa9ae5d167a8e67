"""What a release is judged by, on motions that are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lindy_research.ardusub_comparison.releases import TrueDepth, judge
from lindy_research.ardusub_comparison.sticks import heave_at, judged, practice


def stopped(at: float, way: float, back: float, direction: float, begin: float) -> TrueDepth:
    """1 m/s until `at`; then `way` on within a second, and `back` within the next."""
    t = np.arange(at - 3.0, at + 12.0, 0.002)
    after = t - at
    travelled = np.interp(after, [-3.0, 0.0, 1.0, 2.0], [-3.0, 0.0, way, way - back])
    depth = begin + direction * travelled
    return TrueDepth(t, np.round(depth, 2), np.gradient(depth, t))


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


def test_what_is_judged_is_not_what_settings_are_tried_with() -> None:
    ours, others = judged(), practice()
    assert {abs(move.heave) for move in ours} == {0.0, 1.0}
    assert heave_at(ours, -1.0) == 0.0
    assert heave_at(ours, ours[-1].at) == 0.0
    tried = [move for move in others[3:] if move.heave]
    assert all(abs(move.heave) < 1.0 for move in tried)
    assert sum(move.heave < 0.0 for move in ours) == sum(move.heave > 0.0 for move in ours[3:]) == 4
