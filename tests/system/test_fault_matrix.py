"""A part of the fault matrix: cells that meet every goal go on meeting it.

The whole matrix: `python -m tests.support.faults`. research/measurements/faults.csv has the cells
that miss a goal.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.faults.catalogue import MODES
from tests.support.faults.goals import CellRow, read_rows
from tests.support.once import once

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
CELLS = (
    "manual/none",
    "manual/kill -9 simulator",
    "depth_hold/none",
    "depth_hold/kill -9 control",
    "depth_hold/kill -9 reference",
    "stabilised/none",
    "stabilised/kill -9 estimation",
    "stabilised/SIGSTOP estimation 2 s",
    "stabilised/kill -9 hub_topside",
    "stabilised/SIGSTOP tether 2 s",
    "stabilised/SIGSTOP hub_topside 2 s",
    "stabilised/SIGSTOP hub_drone 2 s",
    "stabilised/cable out 3 s",
    "stabilised/pressure biased 20000",
    "stabilised/pilot of an older version",
    "stabilised/pilot silent 22 s",
    "stabilised/another Lindy on board",
    "stabilised/second control",
    "stabilised/flood of junk on board",
    "stabilised/control ten times too slow",
    "stabilised/SIGSTOP control 0.3 s",
    "stabilised/leak wet",
    "stabilised/battery critical",
    "stabilised/temperature hot",
    "stabilised/stick down to the depth limit",
    "stabilised/magnetometer biased 2e-05",
    "station_keeping/none",
    "follow/none",
    "surfacing/none",
)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> dict[str, CellRow]:
    """Flown by a program of its own, on all cores: it goes on in copies of itself, which a process
    with threads must not."""

    def fly(folder: Path) -> None:
        command = [sys.executable, "-m", "tests.support.faults", "--rows", f"{folder}/rows.jsonl"]
        run = subprocess.run(
            [*command, "--cells", *CELLS], cwd=ROOT, capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, run.stderr

    kept = once(tmp_path_factory, worker_id, "faults", fly) / "rows.jsonl"
    return {f"{row.mode}/{row.fault}": row for row in read_rows(kept)}


@pytest.mark.parametrize("cell", CELLS)
def test_a_cell_meets_every_goal(rows: dict[str, CellRow], cell: str) -> None:
    row = rows[cell]
    assert row.missed == [], row.figures
    assert {"stale", "disarm"} <= set(row.goals)


@pytest.mark.parametrize("mode", [mode.name for mode in MODES])
def test_without_a_fault_nothing_happens(rows: dict[str, CellRow], mode: str) -> None:
    figures = rows[f"{mode}/none"].figures
    assert (figures.failsafes, figures.restarted) == ((), ())
    assert figures.recovered == 0.0
    assert figures.still_armed


def test_a_stopped_service_is_ended_and_started_again_by_the_supervisor(
    rows: dict[str, CellRow],
) -> None:
    figures = rows["stabilised/SIGSTOP estimation 2 s"].figures
    assert figures.restarted == ("estimation",)
    assert "supervisor: estimation does not answer any more" in figures.texts
    assert figures.failsafes == ("state_lost",)


@pytest.mark.parametrize("name", ["tether", "hub_topside", "hub_drone"])
def test_a_disarm_stops_the_thrusters_within_a_second_while_the_way_to_them_hangs(
    rows: dict[str, CellRow], name: str
) -> None:
    figures = rows[f"stabilised/SIGSTOP {name} 2 s"].figures
    assert figures.disarmed is not None
    assert figures.disarmed <= 1.0


def test_a_pilot_who_stays_silent_is_waited_for_then_the_drone_rises_and_resumes(
    rows: dict[str, CellRow],
) -> None:
    figures = rows["stabilised/pilot silent 22 s"].figures
    assert figures.failsafes == ("pilot_lost",)
    read = [text.split("; ")[1] for text in figures.texts if "; resume" in text]
    said = ["the drone has stopped and holds", "the drone rises slowly"]
    assert list(dict.fromkeys(read)) == [*said, "the drone stays at the surface"]
    assert figures.recovered is not None
    assert 22.0 < figures.recovered < 24.0


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("leak wet", "water in the enclosure"),
        ("battery critical", "the battery is nearly empty (8% left)"),
        ("temperature hot", "the enclosure is too hot (85 °C)"),
        ("stick down to the depth limit", "the depth limit: the drone goes no deeper (6 m)"),
        ("control ten times too slow", "a service on board is late (control)"),
        (
            "magnetometer biased 2e-05",
            "a sensor is in trouble (the compass is disturbed and not used (sensor/magnetometer))",
        ),
        ("SIGSTOP control 0.3 s", "a service on board is late (control)"),
    ],
)
def test_the_pilot_reads_what_is_wrong(rows: dict[str, CellRow], fault: str, words: str) -> None:
    assert words in rows[f"stabilised/{fault}"].figures.texts
