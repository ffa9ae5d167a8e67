"""The verb, on short dives: rows are the report's figures, and an interruption loses none."""

import csv
import json
from pathlib import Path

import pytest

import tools.sweep.sweep as module
from tests.support.recorded import without_viewer
from tools.__main__ import main
from tools.choices import Choices
from tools.simulate import simulated
from tools.sweep.axes import Combination, PlannedDive, axes
from tools.sweep.rows import Row, columns, rows_file
from tools.sweep.sweep import Job, fly_one

STICKS = "t,surge,sway,heave,yaw\n0,0,0,0,0\n0.2,0,0,0.6,0.4\n1.5,0,0,0,0\n4,0,0,0,0\n"
QUICK = "estimation.calibration.still_time=2"  # [s]


@pytest.fixture
def script(tmp_path: Path) -> str:
    path = tmp_path / "sticks.csv"
    path.write_text(STICKS)
    return f"script:{path}"


def table_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_a_sweep_writes_a_row_per_dive_and_goes_on_where_it_was_cut(
    tmp_path: Path, script: str, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "kp.csv"
    arguments = ["sweep", "--pilot", script, "--set", QUICK, "--set", "control.depth.kp=40,60"]
    arguments += ["--seed", "1..2", "--out", str(out)]
    assert main(arguments) == 0
    whole = table_of(out)
    assert [(row["control.depth.kp"], row["seed"]) for row in whole] == [
        ("40", "1"), ("40", "2"), ("60", "1"), ("60", "2"),
    ]  # fmt: skip
    assert {row["end"] for row in whole} == {"clean"}
    assert len({row["log_hash"] for row in whole}) == 4
    capsys.readouterr()

    lines = rows_file(out).read_bytes().splitlines(keepends=True)
    rows_file(out).write_bytes(b"".join(lines[:2]) + lines[2][:30])  # killed in the second row
    out.unlink()
    assert main(arguments) == 0
    assert "4 dives, 1 of them done before" in capsys.readouterr().out
    again = table_of(out)
    for before, after in zip(whole, again, strict=True):
        assert {k: v for k, v in before.items() if k != "wall_s"} == {
            k: v for k, v in after.items() if k != "wall_s"
        }
    assert main(arguments) == 0  # nothing is missing
    assert table_of(out) == again
    edited = out.read_bytes() + b"my own line\n"
    out.write_bytes(edited)
    capsys.readouterr()
    assert main(arguments) == 1
    assert "it is not as the sweep wrote it; move it" in capsys.readouterr().err
    assert out.read_bytes() == edited


@pytest.mark.slow
def test_a_dive_that_fails_is_a_row_and_the_exit_status_says_so(
    tmp_path: Path, script: str, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "x.csv"
    times = "estimation.calibration.still_time=2,60"
    assert main(["sweep", "--pilot", script, "--set", times, "--out", str(out)]) == 1
    good, bad = table_of(out)
    assert good["end"] == "clean"
    assert "the drone did not arm within 30 s" in bad["end"]
    error = capsys.readouterr().err
    assert "1 of 2 dives ended with an error; the first, dive 1: the drone did not arm" in error


@pytest.mark.slow
def test_the_row_is_the_report(script: str, tmp_path: Path):
    """Of the same dive, once in memory and once recorded."""
    dive = PlannedDive(3, Combination("pioneer", "severe", script, (QUICK,)), 5)
    in_memory = fly_one(Job(dive, "simulated", None))
    assert in_memory is not None
    kept = tmp_path / "kept"
    choices = Choices(set_=(QUICK,), seed=5, link="severe", pilot=script, out=kept)
    simulated(choices, running=without_viewer())
    report = json.loads((kept / "report.json").read_bytes())
    assert in_memory["log_hash"] == report["log_hash"]
    assert in_memory["energy_wh"] == report["energy"]["wh"]
    assert in_memory["depth_error_rms_m"] == report["depth_error_rms_m"]
    assert json.loads(str(in_memory["losses"])) == report["losses"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--set", "control.depth.kpp=1,2"], "did you mean 'kp'?"),
        (["--set", "control.depth.kp=1,-2"], "control.depth.kp=-2: expected a number >= 0.0"),
        (["--vehicle", "pioneer,minevra"], "did you mean 'minerva'?"),
        (["--link", "tether,tehter"], "did you mean 'tether'?"),
        (["--link", "tether,acoustic"], "cannot be flown"),
        (["--pilot", "gamepad"], "needs real time"),
        (["--pilot", "script:nobody"], "unknown dive 'nobody'"),
        (["--seed", "9..1"], "goes backwards"),
        (["--set", "control.depth.kp=50,"], "--set control.depth.kp=50,: a value is empty"),
        (["--link", "tether,"], "--link tether,: a value is empty"),
        (["--picture", "x.jpg"], "--picture x.jpg: expected a name that ends in .png"),
        (["--seconds", "-1"], "--seconds is -1"),
        (["--workers", "0"], "--workers is 0, expected 1 or more"),
        (["--workers", "1.5"], "expected a whole number"),
        (["--stack", "nothing"], "unknown stack 'nothing'"),
        (["--wing", "3"], "--wing"),
        (["--out", "x.xlsx"], "expected a name that ends in .csv"),
        (["--out", "/dev/null/x.csv"], "cannot write /dev/null/x.csv"),
    ],
)
def test_a_mistake_is_one_sentence_before_the_first_dive(
    arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    words = arguments if "--out" in arguments else [*arguments, "--out", str(tmp_path / "x.csv")]
    assert main(["sweep", *words]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("done", [0, 1])
def test_ctrl_c_keeps_what_is_finished(
    done: int, tmp_path: Path, script: str, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):  # fmt: skip
    out = tmp_path / "x.csv"

    def interrupted(wanted: module.Wanted, finished: module.FinishedDives) -> bool:
        for dive in list(wanted.axes.dives())[:done]:
            row = fly_one(Job(dive, wanted.stack, wanted.seconds))
            assert row is not None
            finished.add(row)
        return True

    monkeypatch.setattr(module, "_fly", interrupted)
    words = ["sweep", "--pilot", script, "--set", QUICK, "--seed", "1..3", "--out", str(out)]
    assert main(words) == 130
    assert f"interrupted; {done} of 3 dives are kept" in capsys.readouterr().err
    assert out.exists() == (done > 0)
    assert not done or len(table_of(out)) == done


def test_the_picture_is_a_png_with_every_figure():
    from tools.sweep.rows import combinations, drawn

    found = axes(["pioneer"], ["tether", "remote"], ["script:a"], [], ["1..2"])
    empty: Row = dict.fromkeys(columns([]))
    rows: list[Row] = [
        empty | {"link": dive.combination.link, "end": "clean", "energy_wh": 1.0}
        for dive in found.dives()
    ]
    assert {k: len(group) for k, group in combinations(rows, found.varied).items()} == {
        "tether": 2,
        "remote": 2,
    }
    assert drawn(rows, found.varied).startswith(b"\x89PNG")
