"""A short virtual soak, and what the soak calls a miss."""

import pytest
from msgspec.structs import replace

from tests.long.virtual_soak import (
    LONGEST_BACK_S,
    MEMORY_MB_H,
    Flown,
    fly,
    memory_words,
    missed,
)
from tests.support.faults.catalogue import FAULTS
from tests.support.faults.figures import Figures

KILLED = next(fault for fault in FAULTS if fault.name == "kill -9 control")
WELL = Figures(
    depth_error=None, jerk_ratio=1.0, stale=0, pilot_lost=None, thrust_zero=None, recovered=1.0,
    announced=0.1, failsafes=(), restarted=("control",), texts=(), still_armed=True,
)  # fmt: skip


@pytest.mark.slow
def test_minutes_of_random_faults_leave_the_pilot_in_control_after_each() -> None:
    flown = fly(hours=0.1, number=12, seed=11)
    assert [one.misses for one in flown.judged] == [()] * 12
    assert any(one.said for one in flown.judged)
    assert flown.restarts > 0
    assert flown.hours >= 0.09


def test_what_goes_well_is_no_miss() -> None:
    assert list(missed(KILLED, WELL, 0.5)) == []


def test_silence_is_harmless_only_where_control_was_kept() -> None:
    silent = replace(WELL, announced=None)
    assert list(missed(KILLED, silent, 0.5)) == ["not said, and control was lost"]
    assert list(missed(KILLED, replace(silent, recovered=0.0), 0.0)) == []


def test_each_miss_is_named() -> None:
    bad = replace(WELL, stale=2, jerk_ratio=1.2, restarted=("control", "tether"), texts=("a", "b"))
    assert list(missed(KILLED, bad, None)) == [
        f"not in control after {LONGEST_BACK_S:.0f} s: a; b",
        "2 actuations of expired commands",
        "jerk 1.200 of its limit",
        "started again: tether",
    ]


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_memory_is_judged_by_the_hour_without_its_beginning(factor: float) -> None:
    per_hour = MEMORY_MB_H * factor
    memory = [(h / 10, 100.0 + per_hour * h / 10 - (50.0 if h < 5 else 0.0)) for h in range(31)]
    flown = Flown(judged=[], hours=3.0, wall_s=1.0, memory=memory, counts=1, restarts=0)
    words, too_fast = memory_words(flown)
    assert too_fast == (factor > 1.0)
    assert f"{per_hour:+.2f} MB per hour" in words
