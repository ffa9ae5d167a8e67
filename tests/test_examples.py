"""Programs and notebooks in examples/ run as a user runs them. The point vehicle: tests/system."""

import json
import re
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from messages.message import Estimate
from tests.support.patience import PATIENCE_S
from tools.__main__ import main

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
QUICK = ("--set", "estimation.calibration.still_time=1")  # [s] at rest instead of ten
ALARM = ("--stack", str(EXAMPLES / "depth_alarm" / "stack.toml"))
DOWN = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.8,0\n5,0,0,0,0\n7,0,0,-0.8,0\n11,0,0,0,0\n"


def program(path: Path) -> ModuleType:
    """One file of an example as a module."""
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def pilot(tmp_path: Path) -> tuple[str, str]:
    path = tmp_path / "script.csv"
    path.write_text(DOWN)
    return "--pilot", f"script:{path}"


# The service of docs/your-own-service.md.


def test_the_alarm_is_raised_once_and_ends_once() -> None:
    alarm = program(EXAMPLES / "depth_alarm" / "depth_alarm.py").DepthAlarm(deepest=3.0)
    told = [alarm.heard(Estimate(depth, 0.01)) for depth in (1.0, 3.1, 2.9, 3.1, 2.7, 2.7)]
    assert [bool(news) for news in told] == [False, True, False, False, True, False]
    assert alarm.heard(Estimate(9.0, 1.0, valid=False)) is None


def test_the_alarm_flies_and_is_counted(
    tmp_path: Path, pilot: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    settings = (*QUICK, "--set", "depth_alarm.deepest=1")
    assert main(["simulate", *ALARM, *settings, *pilot, "--out", str(out)]) == 0
    assert "depth_alarm: too deep: 1.0 m, the limit is 1.0 m" in capsys.readouterr().out
    assert json.loads((out / "report.json").read_text())["losses"]["alarm:depth"] == 1


@pytest.mark.slow
def test_the_alarm_is_silent_where_its_table_in_the_vehicle_file_allows_more(
    tmp_path: Path, pilot: tuple[str, str]
) -> None:
    page = (ROOT / "docs" / "your-own-service.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)
    vehicle, out = tmp_path / "deeper.toml", tmp_path / "out"
    pioneer = (ROOT / "deploy" / "vehicles" / "pioneer.toml").read_text(encoding="utf-8")
    vehicle.write_text(f"{pioneer}\n{table}", encoding="utf-8")
    flown = ["--vehicle", str(vehicle), *QUICK, *pilot, "--out", str(out)]
    assert main(["simulate", *ALARM, *flown]) == 0
    assert "alarm:depth" not in json.loads((out / "report.json").read_text())["losses"]


# The programs of docs/library.md.

LIBRARY = EXAMPLES / "library"
PROGRAMS = sorted(LIBRARY.glob("*.py"))
PD = ("--stack", str(LIBRARY / "pd_stack.toml"))


def run(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(LIBRARY / name), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_of_the_library_page_is_short(path: Path) -> None:
    lines = filter(None, path.read_text(encoding="utf-8").splitlines())
    most = 80 if path.stem == "own_estimator" else 40
    assert len([line for line in lines if not line.startswith(("import ", "from "))]) <= most


@pytest.mark.slow
def test_the_ramp_is_plotted_and_keeps_its_limits(tmp_path: Path) -> None:
    out = tmp_path / "ramp.png"
    done = run("ramp_plot.py", str(out))
    assert done.returncode == 0, done.stderr
    assert out.read_bytes().startswith(b"\x89PNG")
    velocity, acceleration, jerk = map(float, re.findall(r"\d\.\d+", done.stdout))
    assert velocity == 0.5
    assert acceleration <= 0.5
    assert jerk <= 1.5


@pytest.mark.slow
def test_the_ramp_leaves_a_picture_that_is_there(tmp_path: Path) -> None:
    out = tmp_path / "ramp.png"
    out.write_text("mine")
    done = run("ramp_plot.py", str(out))
    assert (done.returncode, out.read_text()) == (1, "mine")
    assert done.stderr == f"{out} exists already; name another file\n"


@pytest.mark.slow
def test_an_own_controller_flies_the_whole_stack(tmp_path: Path, pilot: tuple[str, str]) -> None:
    out = tmp_path / "out"
    assert main(["simulate", *PD, *QUICK, *pilot, "--out", str(out)]) == 0
    report = json.loads((out / "report.json").read_text())
    assert report["exit"] == "clean"
    assert "control" not in report["services"]
    assert report["services"]["pd_control"]["sent"] > 1000
    assert report["depth_error_rms_m"] < 0.2  # without thrust it would be a metre


@pytest.mark.slow
def test_a_virtual_dive_holds_its_depth() -> None:
    done = run("virtual_dive.py", "3")
    assert done.returncode == 0, done.stderr
    states, rms, worst = map(float, re.findall(r"\d+\.?\d*", done.stdout))
    assert states > 1500  # 100 in each second after the start
    assert rms < worst < 50.0  # [cm]


@pytest.mark.slow
def test_the_links_are_ordered_as_their_names_promise() -> None:
    done = run("link_monte_carlo.py", "perfect", "tether", "severe")
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()[1:]]
    assert [row[0] for row in rows] == ["perfect", "tether", "severe"]
    for column in range(1, 5):  # three percentiles and the loss
        values = [float(row[column]) for row in rows]
        assert values == sorted(values)
    assert float(rows[2][4]) > 1.0  # [%] lost


def test_a_link_that_there_is_not_is_one_sentence() -> None:
    done = run("link_monte_carlo.py", "sever")
    assert done.returncode == 1
    assert done.stderr.startswith("unknown link 'sever'; did you mean 'severe'? known: ")
    assert done.stderr.count("\n") == 1


# The notebooks: every cell runs, from the first to the last.


NOTEBOOKS = sorted((Path(__file__).parents[1] / "examples/notebooks").glob("*.ipynb"))
MAKES = {
    "many_dives": ["dives.csv", "dives.pdf"],
    "own_controller": ["controllers.png"],
}
SHORTER = (  # fewer dives than a reader flies, and shorter ones
    ("1..10", "1..2"), ("25,50,100,200", "25,100"), ("--seconds 30", "--seconds 15"),
    ("SECONDS = 60", "SECONDS = 20"),
)  # fmt: skip


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    return [c for c in json.loads(path.read_text("utf-8"))["cells"] if c["cell_type"] == kind]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_carries_no_output(path: Path) -> None:
    for cell in cells(path, "code"):
        assert (cell["outputs"], cell["execution_count"]) == ([], None)
    assert len(cells(path, "markdown")) > 0


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_of_a_notebook_runs(path: Path, tmp_path: Path) -> None:
    pytest.importorskip("pandas", reason="pandas is not installed")
    program = "\n\n".join("".join(cell["source"]) for cell in cells(path, "code"))
    for said, instead in SHORTER:
        program = program.replace(said, instead)
    (tmp_path / "cells.py").write_text(program, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "cells.py"], cwd=tmp_path, capture_output=True, text=True,
        timeout=5.0 * PATIENCE_S, check=False, env={"MPLBACKEND": "Agg", "HOME": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert all((tmp_path / name).stat().st_size > 1000 for name in MAKES[path.stem])
