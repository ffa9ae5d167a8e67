"""The jerk in the viewer: the laws of its filter, and the figures of the report of one dive."""

from functools import cache
from itertools import pairwise
from math import degrees, isnan, pi, sqrt
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from messages import topics
from messages.control import ThrusterCommand
from messages.message import Estimate, Message
from messages.state import VehicleState
from messages.topic import AnyTopic
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.visualizer.computed import (
    BAND,
    LONGEST_NS,
    SETTLE_NS,
    WINDOW,
    JerkLines,
    LowPassedJerk,
    ThrusterChanges,
)
from services.visualizer.core import Collector
from tests.support.messages import example
from tests.support.sortie import DEEP, Sortie
from tools.analysis import spectra as report
from tools.analysis.dive import GatheredDive, RecordedDive

VEHICLE = Stack().section("vehicle", Vehicle)
SECOND = 1_000_000_000  # [ns]
STEP = SECOND // 100
LONG_S = 24.0
AGREES = 0.1  # [-] the edge of a filter is not that of a sum over a spectrum
Numbers = list[float]


class Flown(NamedTuple):
    curves: dict[str, tuple[Numbers, list[Numbers]]]  # [s] and rows of each path
    dive: RecordedDive


@cache
def flown() -> Flown:
    """A dive with surge, heave and yaw, drawn by the viewer second by second, and as recorded."""
    rows = [(1.0, (0.5, 0.0, 0.8, 0.0)), (6.0, (0.0, 0.0, 0.0, 0.0))]
    rows += [(10.0, (0.0, 0.0, -0.5, 0.8)), (15.0, (0.0, 0.0, 0.0, 0.0))]
    sortie = Sortie(rows, seed=3, overrides=(DEEP,)).until(LONG_S)
    said: list[tuple[AnyTopic, Message]] = []
    for topic, messages in (
        (topics.STATE, sortie.states),
        (topics.REFERENCE, sortie.references),
        (topics.THRUSTERS, sortie.commands),
    ):
        said += [(topic, m) for m in messages]
    armed = next(m.stamp_ns for m in sortie.references if m.armed)
    said = sorted((t for t in said if t[1].stamp_ns >= armed), key=lambda pair: pair[1].stamp_ns)
    said = [pair for pair in said if pair[1].stamp_ns < armed + (LONG_S - 1.0) * SECOND]
    collector, gathered = Collector(VEHICLE, start=armed), GatheredDive()
    curves: dict[str, tuple[Numbers, list[Numbers]]] = {}
    drain = armed + SECOND

    def draw(now: int) -> None:
        for columns in collector.drain(now).columns:
            times, points = curves.setdefault(columns.path, ([], []))
            times.extend([time / SECOND for time in columns.times])
            points.extend([list(row) for row in columns.rows])

    for topic, message in said:
        collector.hear(topic, topic.key, message, message.stamp_ns)
        gathered.add(topic.key, message, message.stamp_ns)
        if message.stamp_ns >= drain:
            draw(drain)
            drain += SECOND
    draw(drain)
    return Flown(curves, gathered.dive({}, {}))


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["heave", "yaw"])
@pytest.mark.parametrize("who", ["felt", "reference"])
def test_the_viewer_shows_the_jerk_of_the_report(axis: str, who: str) -> None:
    found = report.smoothness(flown().dive)
    told = found.heave if axis == "heave" else found.yaw
    assert told is not None
    expected = told.felt if who == "felt" else told.reference
    times, rows = flown().curves[f"jerk_{axis}/{who}"]
    unit = 1.0 if axis == "heave" else degrees(1.0)
    at = np.arange(0.0, LONG_S - 1.0, 1.0 / report.RATE)
    line = np.interp(at, times, [row[0] / unit for row in rows])
    drawn = report.spectrum(line, report.RATE).rms(BAND)  # the same windows over the same moves
    assert drawn == pytest.approx(expected, rel=AGREES)


@pytest.mark.slow
def test_the_viewer_counts_the_starts_and_reversals_of_the_report() -> None:
    times, rows = flown().curves["thruster_changes"]
    dive = flown().dive
    starts, reversals = report.thruster_changes(dive)
    minutes = dive.armed_seconds / 60.0
    assert sum(starts) > 0.0
    for told, drawn in zip((starts, reversals), rows[-1], strict=True):
        assert drawn <= sum(told) * minutes + 0.1
    stamps = dive[topics.THRUSTERS]["stamp_ns"]
    late = stamps >= stamps[0] + int(times[-1]) * SECOND
    ahead, astern = (report.bits(dive[topics.THRUSTERS][n], 4) for n in ("ahead", "astern"))
    on = ahead | astern
    since = np.count_nonzero((on[1:] & ~on[:-1])[late[1:]])
    assert rows[-1][0] + since == pytest.approx(sum(starts) * minutes, abs=0.1)


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
