"""The long runs of tests/long, each for a moment."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.long.mutants import Copy
from tests.long.seams import SEAMS, Seam
from tests.long.soak import fly

ROOT = Path(__file__).parents[1]
BROKEN = """
from typing import NamedTuple
import pytest
from hypothesis import given, settings, strategies as st

class Limits(NamedTuple):
    jerk: float
    peak: float

@pytest.mark.parametrize("side", ["left"])
@settings(max_examples=5)
@given(v=st.floats(0.0, 9.0), lim=st.builds(Limits, st.just(1.0), st.just(2.0)))
def test_slow(side, v, lim):
    assert v < 4.0

@settings(max_examples=5)
@given(st.data())
def test_drawn(data):
    assert data.draw(st.integers()) < 10

@settings(max_examples=5)
@given(st.integers())
def test_that_holds(n):
    assert n == n
"""


def test_each_find_is_printed_as_the_line_that_brings_it_back(tmp_path: Path) -> None:
    (tmp_path / "test_broken.py").write_text(BROKEN)
    run = [sys.executable, "-m", "pytest", "-p", "tests.long.explore", "--tb=no", "-n", "0"]
    run += ["--hypothesis-profile", "explore", "-c", "pyproject.toml", str(tmp_path)]
    done = subprocess.run(run, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    _, _, finds = done.stdout.partition("cases to keep")
    lines = [line.strip() for line in finds.splitlines()]
    assert "@example(v=4.0, lim=Limits(1.0, 2.0))" in lines
    assert any(line.startswith("@reproduce_failure(") for line in lines)
    assert "test_that_holds" not in finds


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    return Copy(tmp_path_factory.mktemp("copy"))


@pytest.mark.slow
@pytest.mark.parametrize("seam", SEAMS, ids=lambda seam: seam.name)
def test_no_fault_at_a_seam_goes_unnoticed(copy: Copy, seam: Seam) -> None:
    text = Path(seam.file).read_text(encoding="utf-8")
    assert text.count(seam.before) == 1, f"{seam.file} has changed: {seam.before}"
    fault = text.replace(seam.before, seam.after)
    assert copy.outcome_with(seam.file, fault, seam.tests, "not slow and not system") == "failed"


@pytest.mark.slow
def test_minutes_of_random_faults_leave_the_pilot_in_control_after_each() -> None:
    flown = fly(hours=0.05, number=8, seed=11)
    assert [one.misses for one in flown.judged] == [()] * 8
    assert any(one.said for one in flown.judged)
    assert flown.restarts > 0
    assert flown.hours >= 0.04
