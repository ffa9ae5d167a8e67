"""`lindy ros2`: a dive that goes on is shown in ROS 2 by a process of its own."""

import os
from pathlib import Path

import msgspec
import pytest

from services.runtime.config.running import RUNNING, Running
from services.runtime.config.settings import DEPLOY
from services.runtime.hosts.process_host import Launch
from tools.__main__ import main


def going_on(folder: Path, **pids: int) -> Path:
    running = Running("rov-7", {"topside": "tcp/127.0.0.1:1", "drone": "b"}, os.getpid(), pids)
    (folder / RUNNING).write_bytes(msgspec.json.encode(running))
    return folder


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> list[Launch]:
    """What was started."""
    found: list[Launch] = []

    def run(launch: Launch) -> int:
        found.append(launch)
        return 0

    monkeypatch.setattr("tools.ros2.run_services", run)
    return found


def test_it_joins_the_hubs_of_that_dive_in_the_name_of_its_drone(
    tmp_path: Path, launched: list[Launch]
) -> None:
    words = ["ros2", "--dive", str(going_on(tmp_path)), "--set", "ros2.sticks=true"]
    assert main(words) == 0
    (launch,) = launched
    assert [*launch.services] == ["ros2"]
    assert launch.services["ros2"].sides == ["topside", "drone"]
    assert launch.endpoints["topside"] == "tcp/127.0.0.1:1"
    assert launch.stack.drone_name == "rov-7"
    assert launch.stack.overrides == ["ros2.sticks=true"]


def test_it_has_the_vehicle_file_and_the_settings_of_the_dive(
    tmp_path: Path, launched: list[Launch]
) -> None:
    file = DEPLOY / "vehicles" / "bluerov2_heavy.toml"
    folder = going_on(tmp_path)
    running = msgspec.json.decode((folder / RUNNING).read_bytes(), type=Running)
    running = msgspec.structs.replace(running, vehicle_file=str(file), overrides=("ros2.domain=4",))
    (folder / RUNNING).write_bytes(msgspec.json.encode(running))
    assert main(["ros2", "--dive", str(folder)]) == 0
    assert launched[0].stack.vehicle_path == file
    assert launched[0].stack.overrides == ["ros2.domain=4"]


@pytest.mark.parametrize(
    ("pids", "more", "sentence"),
    [
        ({"ros2": 1}, [], "the dive of rov-7 is in ROS 2 already, by its stack file"),
        ({}, ["--set", "ros2.domain=-1"], "ros2.domain"),
        ({}, ["--set", "ros2.sticsk=true"], "sticsk"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    pids: dict[str, int],
    more: list[str],
    sentence: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["ros2", "--dive", str(going_on(tmp_path, **pids)), *more]) == 1
    said = capsys.readouterr().err
    assert sentence in said
    assert len(said.splitlines()) == 1
