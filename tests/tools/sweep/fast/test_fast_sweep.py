"""`lindy sweep --fast` beside the exact sweep: the same figures, and refusals."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.goal_runs import random_sticks
from tools.__main__ import main
from tools.sweep.axes import Combination, PlannedDive
from tools.sweep.fast.batch import DiveBatch, FlownBatch, batches, exact_row, fly_batch
from tools.sweep.one_dive import Job, fly_one
from tools.sweep.rows import FLOWN, OF_MESSAGES, Cell, Row

STICKS = "t,surge,sway,heave,yaw\n0,0,0,0,0\n0.1,0.2,0,0.6,0.4\n1,0,0,0,0\n4,0,0,0,0\n"
QUICK = "estimation.calibration.still_time=2"  # [s]
OWN = ("wall_s", "folder", FLOWN)
CLOSE = 1e-6  # [-] of a figure, or of its unit: rounding, while both go the same way
# What a decision that falls otherwise, because of rounding, may do to a figure of a whole dive.
OTHERWISE: dict[str, float] = {
    "depth_overshoot_max_m": 3e-3, "depth_overshoot_p95_m": 3e-3, "depth_overshoot_p50_m": 3e-3,
    "turn_overshoot_max_deg": 0.05, "turn_overshoot_p95_deg": 0.05, "turn_overshoot_p50_deg": 0.05,
    "depth_error_rms_m": 1e-3, "heading_error_rms_deg": 0.05, "deepest_m": 5e-3,
}  # fmt: skip
SHARE = 0.01  # [-] the same of energy and thrust


def script_of(folder: Path, text: str = STICKS) -> str:
    path = folder / "sticks.csv"
    path.write_text(text)
    return f"script:{path}"


def both(combination: Combination, seeds: range, seconds: float) -> list[tuple[Row, Row]]:
    """Fast and exact rows."""
    dives = tuple(PlannedDive(n, combination, seed) for n, seed in enumerate(seeds))
    flown = fly_batch(DiveBatch(dives, seconds))
    assert flown is not None
    exact = [fly_one(Job(dive, "simulated", seconds, "")) for dive in dives]
    by_number = {row["dive"]: row for row in flown.rows}
    return [
        (by_number[row["dive"]], exact_row(row))
        for row in exact
        if row is not None and row["dive"] in by_number
    ]


def is_close(one: Cell, other: Cell) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return one == pytest.approx(other, rel=CLOSE, abs=CLOSE)
    return one == other


@pytest.mark.parametrize("link", ["tether", "perfect"])
def test_a_fast_dive_has_the_figures_of_the_exact_one(link: str, tmp_path: Path):
    overrides = (QUICK, "simulator.floor_depth=60")
    combination = Combination("pioneer", link, script_of(tmp_path), overrides)
    pairs = both(combination, range(5, 6), 1.5)
    assert len(pairs) == 1
    for fast, exact in pairs:
        assert (fast[FLOWN], exact[FLOWN]) == ("fast", "exact")
        assert set(fast) == set(exact)
        assert not set(fast) & set(OF_MESSAGES)
        for name in set(fast) - set(OWN):
            assert is_close(fast[name], exact[name]), name


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["pioneer", "bluerov2_heavy", "minerva"])
def test_six_dives_of_each_vehicle_have_the_figures_of_the_exact_ones(vehicle: str, tmp_path: Path):
    """A minute of random sticks each; all but one at most to rounding."""
    close, pairs = 0, list[tuple[Row, Row]]()
    for pilot in range(2):
        rows, _ = random_sticks(100 + pilot, 55.0)
        lines = [f"{t:.2f},{','.join(map(str, wish))}" for t, wish in rows]
        heading = "t,surge,sway,heave,yaw"
        text = "\n".join([heading, "0,0,0,0,0", *lines, "70,0,0,0,0\n"])
        combination = Combination(
            vehicle, "tether", script_of(tmp_path, text), ("simulator.floor_depth=60",)
        )
        pairs += both(combination, range(3 * pilot, 3 * pilot + 3), 60.0)
    assert len(pairs) >= 5  # the others are flown exactly
    for fast, exact in pairs:
        same = True
        for name in set(fast) - set(OWN):
            if is_close(fast[name], exact[name]):
                continue
            same = False
            assert fast[name] == pytest.approx(exact[name], rel=SHARE, abs=OTHERWISE.get(name, 0.0))
        close += same
    assert close >= len(pairs) - 1


def test_a_sweep_that_goes_on_counts_the_rows_it_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """The worker's function, in this process; a lane that is lost is flown exactly."""
    from tools.sweep import sweep as module

    def in_turn(work: Any, jobs: Any, *_: Any) -> Any:
        yield from enumerate([work(job) for job in jobs])

    def one_lost(batch: DiveBatch) -> FlownBatch:
        flown = fly_batch(batch)
        assert flown is not None
        return flown._replace(rows=flown.rows[1:], left=[batch.dives[0]])

    monkeypatch.setattr(module, "on_all_cores", in_turn)
    monkeypatch.setattr(module, "fly_batch", one_lost)
    out, script = tmp_path / "x.csv", script_of(tmp_path)
    arguments = ["sweep", "--fast", "--pilot", script, "--set", QUICK, "--seconds", "0.5"]
    arguments += ["--seed", "1..2", "--out", str(out)]
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert "no figures of messages: stick_to_thruster_p50_ms" in said
    assert "1 of 2 dives left what the arrays know and were flown exactly" in said
    with out.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row[FLOWN] for row in rows] == ["exact", "fast"]
    assert not set(rows[0]) & set(OF_MESSAGES)
    first = json.loads(out.with_name("x.csv.rows.jsonl").read_text().splitlines()[0])
    assert first["fast"] is True


def test_batches_hold_dives_of_one_combination():
    one, other = (Combination("pioneer", "tether", "script:first_dive", (kp,)) for kp in "ab")
    dives = [PlannedDive(n, one if n < 700 else other, n) for n in range(900)]
    found = batches(dives, 60.0, 2)
    assert sorted(dive.number for batch in found for dive in batch.dives) == list(range(900))
    assert all(len({dive.combination for dive in batch.dives}) == 1 for batch in found)
    assert max(len(batch.dives) for batch in found) <= 225
    assert max(len(batch.dives) for batch in batches(dives, None, 1)) <= 500
    few = batches(dives[:20], 40_000.0, 2)  # of a script that is short
    assert [len(batch.dives) for batch in few] == [20]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--set", "simulator.waves={height=0.1, period=4}"], "does not know simulator.waves"),
        (["--set", "simulator.current.north=0.2"], "does not know simulator.current"),
        (["--set", "control.depth.observer=0"], "does not know control.depth.observer = 0"),
        (["--set", "control.adaptation.on=false"], "does not know --set control.adaptation.on"),
        (["--set", "tether.x=1"], "tether"),
        (["--set", "estimation.calibration.still_time=1"], "it knows 1.5 s and more"),
        (["--link", "severe"], "of the link severe; it knows links that only delay"),
        (["--pilot", "script:incidents"], "does not know the event"),
        (["--pilot", "script:survey"], "does not know the event"),
        (["--record"], "drop one of them"),
        (["--set", "vehicle.mounting.imu.position=[0.1, 0, 0]"], "a mounting of the sensors"),
    ],
)
def test_what_the_arrays_do_not_know_is_refused_in_one_sentence(
    arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "x.csv"
    assert main(["sweep", "--fast", *arguments, "--out", str(out)]) == 1
    error = capsys.readouterr().err
    assert says in error
    assert len(error.strip().splitlines()) == 1
    assert not out.exists()
