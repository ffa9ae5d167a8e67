"""The jerk in the viewer: the laws of its filter, and the figures of the report of one dive."""

from itertools import pairwise
from math import isnan, pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from messages import topics
from messages.control import ThrusterCommand
from messages.message import Estimate
from messages.state import VehicleState
from services.visualizer.computed import (
    BAND,
    LONGEST_NS,
    SETTLE_NS,
    WINDOW,
    JerkLines,
    LowPassedJerk,
    ThrusterChanges,
)
from tests.support.messages import example
from tools.analysis import spectra as report

SECOND = 1_000_000_000  # [ns]
STEP = SECOND // 100
Numbers = list[float]


def test_an_estimate_that_is_lost_ends_its_line_once() -> None:
    line = JerkLines()
    here, lost = Estimate(0.0, 0.1), Estimate(0.0, 0.1, valid=False)
    state = example(VehicleState, phase="running")
    drawn = Numbers()
    for at in range(0, 3 * SECOND, STEP):
        known = here if at < 2 * SECOND else lost
        message = replace(state, sensor_ns=at, depth_acceleration=known, yaw_rate=lost)
        for columns in line.hear(topics.STATE, [message], [at]):
            assert columns.path == "jerk_heave/felt"
            drawn += [row[0] for row in columns.rows]
    assert [isnan(value) for value in drawn] == [*[False] * (len(drawn) - 1), True]
    assert len(drawn) > 10


@pytest.mark.parametrize("hertz", [0.3, 0.7, 1.3])
@pytest.mark.parametrize("of_rate", [False, True])
def test_a_sine_within_the_band_keeps_its_jerk(hertz: float, of_rate: bool) -> None:
    """Above it, nearly nothing is left: a tenth at twice the edge."""
    assert BAND == report.BAND
    assert size_of(hertz, of_rate=of_rate) == pytest.approx(1.0, abs=0.03)
    assert size_of(2.0 * BAND, of_rate=of_rate) < 0.1


def size_of(hertz: float, *, of_rate: bool, step: int = STEP) -> float:
    """[-] Jerk behind the filter, of one that is 1."""
    w = 2.0 * pi * hertz
    jerk, seen = LowPassedJerk(of_rate), Numbers()
    for at in range(0, 20 * SECOND, step):
        t = at / SECOND
        jerk.step(np.cos(w * t) / w**2 if of_rate else np.sin(w * t) / w, at)
        if t > 5.0:
            assert jerk.jerk is not None
            seen.append(jerk.jerk)
    return float(np.std(seen)) * sqrt(2.0)


@settings(max_examples=20, deadline=None)
@given(st.integers(5, 60))
def test_samples_that_a_link_has_thinned_out_say_the_same(milliseconds: int) -> None:
    assert size_of(0.5, of_rate=False, step=milliseconds * SECOND // 1000) == pytest.approx(
        1.0, abs=0.05
    )


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.tuples(st.one_of(st.none(), st.floats(-50, 50)), st.integers(-9, 400)), max_size=80)
)
def test_after_a_gap_it_is_known_again_only_when_the_gap_is_forgotten(
    samples: list[tuple[float | None, int]],
) -> None:
    jerk, at, known_since = LowPassedJerk(of_rate=False), 0, None
    for value, milliseconds in samples:
        step = milliseconds * SECOND // 1000
        at += step
        jerk.step(value, at)
        if value is None:
            known_since = None
        elif known_since is None or not 0 <= step <= LONGEST_NS:
            known_since = at
        if known_since is None or at - known_since <= SETTLE_NS:
            assert jerk.jerk is None
        else:
            assert jerk.jerk is None or not isnan(jerk.jerk)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.sampled_from([-1.0, 0.0, 1.0]), min_size=1, max_size=200))
def test_only_the_last_minute_is_counted(thrust: Numbers) -> None:
    """One command each second."""
    changes, seconds = ThrusterChanges(), [*thrust, *[0.0] * (WINDOW + 1)]
    for k, newton in enumerate(seconds):
        command = ThrusterCommand(
            stamp_ns=k * SECOND, sensor_ns=None, pilot_ns=None, thrust=(newton,)
        )
        columns = changes.hear([command], [k * SECOND])
        starts = [a == 0.0 != b for a, b in pairwise(seconds[max(0, k - WINDOW - 1) : k])]
        assert bool(columns) == (k > 0)
        if columns:
            assert columns[0].rows[0][0] == sum(starts)
