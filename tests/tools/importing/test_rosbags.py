"""A bag becomes a recording; what is odd is counted, what is wrong refused."""

import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from messages.pilot import PilotCommand
from messages.sensors import ImuSample, PressureSample
from services.marine.vehicle import GRAVITY
from tests.tools.test_cli_verbs import complaint
from tools.__main__ import main

from .logs import (
    BEGAN_NS,
    IMU_HZ,
    SECONDS,
    SLOW_HZ,
    WRITERS,
    S,
    imported,
    messages,
    odd,
    of,
    report,
    ros1,
)

SHIPPED = Path("deploy/imports/ros.toml")


def with_board_clock(folder: Path) -> Path:
    """The shipped map, with the stamps of a board."""
    path = folder / "board.toml"
    path.write_text(SHIPPED.read_text().replace('clock = "logger"', 'clock = "board"'))
    return path


def test_every_message_is_there_in_si_and_our_axes(tmp_path: Path) -> None:
    out = imported(ros1(tmp_path / "a.bag"), tmp_path / "dive")
    samples = of(out, "sensor/imu", ImuSample)
    assert [one.seq for one in samples] == [*range(SECONDS * IMU_HZ)]
    assert samples[0].specific_force == pytest.approx((0.0, -0.5, -GRAVITY), abs=0.1)
    assert samples[0].angular_rate == pytest.approx((0.1, -0.2, -0.3), abs=0.1)
    times = [one.publish_ns for one in messages(out, "sensor/imu")[:2]]
    assert times == [BEGAN_NS, BEGAN_NS + S // IMU_HZ]
    depths = of(out, "sensor/pressure", PressureSample)
    assert depths[-1].pressure == pytest.approx(101325.0 + 500.0 * 3.9, abs=1.0)
    assert len(of(out, "pilot/command", PilotCommand)) == SECONDS * SLOW_HZ
    assert odd(out) == {}
    assert "sensor/dvl" in report(out)["missing"]


def test_a_board_s_stamps_are_put_on_the_logger_s_clock(tmp_path: Path) -> None:
    """Samples arrive with a random delay; afterwards they are even again."""
    log = ros1(tmp_path / "a.bag", "board")
    options = ("--map", str(with_board_clock(tmp_path)))
    samples = messages(imported(log, tmp_path / "dive", *options), "sensor/imu")
    stamps = np.array([one.message.stamp_ns for one in samples])
    arrivals = np.array([one.log_ns - one.publish_ns for one in samples])
    assert np.all(arrivals >= 0)
    assert np.max(np.abs(np.diff(stamps) - S // IMU_HZ)) < 1_000_000
    assert np.median(arrivals) > 1_000_000


@pytest.mark.parametrize(
    ("kind", "found"),
    [
        ("nan", {"sensor/imu: specific_force is not a number, left out": 1}),
        ("gap", {"sensor/imu: gap [s]": 1, "sensor/pressure: gap [s]": 1}),
        ("twice", {"sensor/imu: stamp not newer than the one before [s], left out": 100}),
    ],
)
def test_what_is_odd_is_counted(tmp_path: Path, kind: str, found: dict[str, int]) -> None:
    out = imported(ros1(tmp_path / "a.bag", kind), tmp_path / "dive")
    counted = {name: count for name, count in odd(out).items() if not name.startswith("pilot")}
    assert counted == found


def test_every_verb_that_looks_into_a_recording_takes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(imported(ros1(tmp_path / "a.bag"), tmp_path / "dive"))
    for verb in ("info", "check"):
        assert main(["log", verb, out]) == 0
    assert main(["log", "export", "--as", "csv", out, "--out", str(tmp_path / "tables")]) == 0
    capsys.readouterr()
    assert main(["replay", out, "--through", "estimation", "--diff"]) == 0
    assert f"{SECONDS * IMU_HZ} of state" in capsys.readouterr().out


def test_a_dive_that_is_there_stays_as_it_is(tmp_path: Path) -> None:
    log = ros1(tmp_path / "a.bag")
    before = imported(log, tmp_path / "dive").joinpath("dive.mcap").read_bytes()
    imported(log, tmp_path / "dive")
    assert (tmp_path / "dive" / "dive.mcap").read_bytes() == before
    assert (tmp_path / "dive-2" / "dive.mcap").exists()


def cut_off(path: Path) -> Path:
    data = ros1(path.with_name("whole.bag")).read_bytes()
    path.write_bytes(data[: len(data) // 2])
    return path


@pytest.mark.parametrize(
    ("log", "said"),
    [
        (cut_off, "is damaged or was not finished"),
        (partial(ros1, kind="unset"), 'write clock = "board" at sensor_msgs/msg/'),
        (
            partial(ros1, unit=GRAVITY / 1000.0),
            'which cannot be (4 to 25); write unit = "mg" in the map',
        ),
    ],
)
def test_a_wrong_log_is_one_sentence_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], log: Callable[[Path], Path], said: str
) -> None:
    path = log(tmp_path / "a.bag")
    out = tmp_path / "dives" / "dive"
    assert said in complaint(capsys, "import", str(path), "--out", str(out))
    assert not out.parent.exists()


@pytest.mark.parametrize("log", [Path("nowhere.bag"), Path("README.md")])
def test_what_is_no_log_is_one_sentence(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert str(log) in complaint(capsys, "import", str(log))


def numbers(path: Path) -> Path:
    path.write_text("time\n1\n")
    return path


@pytest.mark.parametrize(
    ("name", "package"),
    [
        ("a.bag", "rosbags"),
        ("a.mcap", "rosbags"),
        ("a.bin", "pymavlink"),
        ("a.tlog", "pymavlink"),
        ("a.ulg", "pyulog"),
        ("a.csv", "pyarrow"),
    ],
)
def test_a_missing_package_is_one_sentence_that_names_the_extra(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    package: str,
) -> None:
    log = {**WRITERS, "a.csv": numbers}[name](tmp_path / name)
    for module in [each for each in sys.modules if each.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, package, None)
    said = complaint(capsys, "import", str(log), "--out", str(tmp_path / "dive"))
    assert f"need {package}, which is missing" in said
    assert "--extra import" in said


BAG = "stepDepth_2016-05-25-09-34-20.bag"


def test_a_real_bag_is_imported(tmp_path: Path) -> None:
    log = Path(os.environ.get("LINDY_REAL", "")) / BAG
    if not log.is_file():
        pytest.skip(f"LINDY_REAL names no folder with {BAG}")
    out = imported(log, tmp_path / "dive", "--map", "rovio")
    assert len(messages(out, "sensor/imu")) == 3070
    assert len(messages(out, "sensor/pressure")) == 277
