"""The programs in examples/ run as a user runs them. The point vehicle: tests/system."""

import json
import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from messages.message import Estimate
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


def test_a_mistyped_setting_of_the_alarm_is_one_sentence(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["simulate", *ALARM, "--set", "depth_alarm.deepst=3"]) == 1
    said = "lindy: --set depth_alarm.deepst=3: unknown key; did you mean 'deepest'? known: deepest"
    assert capsys.readouterr().err == f"{said}\n"
