"""The stack as processes, in real time, over UDP on 127.0.0.1, with a board that is a process too.

The board is the double; and ArduSub's own firmware in its simulator, where LINDY_ARDUSUB names its
executable (several are separated by colons).
"""

import json
import os
import signal
import socket
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.sensors import ImuSample, PressureSample
from messages.state import VehicleState
from services.ardusub.service import ONE_BOARD
from services.mavlink_io.io.endpoint import MavlinkEndpoint
from services.mavlink_io.io.links import Links
from services.mavlink_io.packet import MavCommand, command
from services.runtime.config.settings import deploy_file
from tests.support.ardusub_double.wire import (
    BOARDS,
    DOWN,
    FIRMWARE,
    NEUTRAL,
    NO_FIRMWARE,
    S,
    Wire,
    board_process,
)
from tests.support.doors import free_port
from tests.support.patience import until
from tests.support.started import Started
from tools.analysis.dive import read_dive
from tools.recordings.recording import open_recording

SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.8,0\n5,0,0,0,0\n9,0,0,0,0\n"
THRUSTER = "[[vehicle.thruster]]"
ON_A_BOARD = ("dive", "--stack", "ardusub", "--headless", "--vehicle")


def url(port: int) -> str:
    return f"ardusub.url=udpin:127.0.0.1:{port}"


@pytest.fixture
def port() -> int:
    return free_port(socket.SOCK_DGRAM)


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.parametrize("kind", FIRMWARE or [NO_FIRMWARE])
def test_the_driver_alone_on_the_wire(tmp_path: Path, kind: str, port: int) -> None:
    wire = Wire(port)
    with board_process(kind, port, tmp_path):
        wire.wait_for(lambda: wire.driver.stage == "accepted")
        wire.run(3.0)
        imu = [m for _, m in wire.samples if isinstance(m, ImuSample)]
        assert len(imu) > 200
        assert imu[-1].specific_force[2] == pytest.approx(-9.81, abs=0.5)
        assert [m for _, m in wire.samples if isinstance(m, PressureSample)]
        wire.say(command(1, MavCommand.SET_MESSAGE_INTERVAL, 36, 10_000))
        wire.thrust = DOWN
        wire.wait_for(lambda: wire.armed)
        wire.texts.clear()  # a board may say "Lost manual control" of the time before any sticks
        assert wire.until(lambda: bool(wire.servo) and wire.servo != NEUTRAL) < 5.0, wire.said
        wire.run(0.5)
        expected = 1500 - (wire.driver.path.mixed.pulses[2] - 1500)
        assert wire.servo == [1500] * 4 + [expected] * 4
        wire.thrust = None
        assert wire.until(lambda: wire.servo == NEUTRAL) < 1.5
        assert wire.until(lambda: not wire.armed, 10.0) < 6.0
        assert "Lost manual control" not in wire.texts
        wire.thrust = DOWN
        assert wire.until(lambda: wire.servo != NEUTRAL) < 10.0
        wire.alive = False  # the service dies, and the board is on its own
        assert wire.until(lambda: wire.servo == NEUTRAL, 10.0) < 5.0
        assert wire.until(lambda: not wire.armed, 10.0) < 3.0
        assert "Lost manual control" in wire.texts
    wire.links.close()


def dive(folder: Path, port: int, vehicle: str, *overrides: str) -> Path:
    """The folder of a dive that ended in order."""
    sets = (word for each in (url(port), *overrides) for word in ("--set", each))
    with Started(folder / "out", *ON_A_BOARD, vehicle, *sets, script=SCRIPT) as flown:
        flown.report()
    return flown.out


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.parametrize("kind", BOARDS)
def test_a_dive_as_processes(tmp_path: Path, kind: str, port: int) -> None:
    with board_process(kind, port, tmp_path):
        out = dive(tmp_path, port, "bluerov2_heavy")
    report = json.loads((out / "report.json").read_text())
    assert report["exit"] == "clean"
    assert report["services"]["ardusub"]["restarts"] == 0
    assert (read_dive(open_recording(out)).max_depth_m or 0.0) > 0.3


def six_thrusters(folder: Path) -> Path:
    """The BlueROV2 that is not a Heavy: two vertical thrusters, none of which can pitch it."""
    head, *thrusters = deploy_file("vehicles", "bluerov2_heavy").read_text().split(THRUSTER)
    rest = thrusters[7][thrusters[7].index("\n[sensors]") :]
    middle = [text.replace("position = [0.12, ", "position = [0.0, ") for text in thrusters[4:6]]
    path = folder / "bluerov2.toml"
    path.write_text(THRUSTER.join([head, *thrusters[:4], *middle]) + rest)
    return path


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.parametrize("kind", FIRMWARE or [NO_FIRMWARE])
def test_a_bluerov2_with_six_thrusters_dives_and_holds_its_depth(
    tmp_path: Path, kind: str, port: int
) -> None:
    vehicle, no_pitch = str(six_thrusters(tmp_path)), "control.pitch={ kp = 0.0, kd = 0.0 }"
    with board_process(kind, port, tmp_path, {"FRAME_CONFIG": 1.0}, model="vectored"):
        out = dive(tmp_path, port, vehicle, no_pitch)
    recorded = [found.message for found in open_recording(out)]
    last = max(m.stamp_ns for m in recorded if isinstance(m, ThrusterCommand) and m.armed)
    states = [m for m in recorded if isinstance(m, VehicleState) and m.stamp_ns < last]
    resting = [m.depth.value for m in states if m.stamp_ns > last - S]  # sticks centred for 3 s
    assert min(resting) > 0.3
    assert max(resting) - min(resting) < 0.03


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.parametrize("wanted", ["disarm", "mode"])
@pytest.mark.parametrize("kind", FIRMWARE or [NO_FIRMWARE])
def test_another_ground_station_is_obeyed(
    tmp_path: Path, kind: str, wanted: str, port: int
) -> None:
    wire = Wire(port)
    with board_process(kind, port, tmp_path):
        wire.flying()
        wire.another_says(command(1, *((400, 0) if wanted == "disarm" else (176, 1, 2))))
        wire.wait_for(lambda: wire.driver.authority.taken)
        if wanted == "disarm":
            wire.wait_for(lambda: wire.servo == NEUTRAL)
        assert [text for text in wire.said if "somebody else has the vehicle" in text]
        assert not wire.driver.authority.sends_sticks
        wire.run(3.0)  # in which it would have armed again, or set the mode back
        assert wire.driver.authority.taken
        if wanted == "disarm":
            assert not wire.armed
            assert wire.servo == NEUTRAL
    wire.links.close()


class Beside:
    """The outputs of a firmware, on its second link, by the board's own clock."""

    def __init__(self, port: int) -> None:
        outbox = Outbox()
        self.links = Links([f"udpin:127.0.0.1:{port}"], "url", ONE_BOARD, outbox)
        self.board = MavlinkEndpoint(self.links, outbox, 250, 191)
        self.at, self.servo = 0.0, list[int]()  # [s] and [µs] of the newest
        self._asked = 0.0  # [s]

    def until(self, happened: Callable[[], bool]) -> None:
        def listen() -> None:
            if (now := time.monotonic()) > self._asked + 1.0:
                self._asked = now
                self.board.send(command(1, MavCommand.SET_MESSAGE_INTERVAL, 36, 10_000))
            for packet in self.board.receive():
                if packet.name == "SERVO_OUTPUT_RAW" and not happened():
                    self.at = packet.fields["time_usec"] / 1e6
                    self.servo = [packet.fields[f"servo{n}_raw"] for n in range(1, 9)]

        until(happened, lambda: self.servo, listen)


@pytest.mark.system
@pytest.mark.parametrize("kind", FIRMWARE or [NO_FIRMWARE])
def test_when_all_of_lindy_is_killed_the_board_is_neutral_after_its_timeout(
    tmp_path: Path, kind: str, port: int
) -> None:
    second = free_port(socket.SOCK_DGRAM)
    script = "t,surge,sway,heave,yaw\n0,0,0,1,0\n60,0,0,0,0\n"
    beside = Beside(second)
    with board_process(kind, port, tmp_path, beside=second):
        words = (*ON_A_BOARD, "bluerov2_heavy", "--set", url(port))
        dive = Started(tmp_path / "out", *words, script=script, before=("setsid",))
        try:
            beside.until(lambda: max(beside.servo, default=0) > 1600)
        finally:
            os.killpg(dive.process.pid, signal.SIGKILL)  # as when its computer dies
            dive.process.wait()
        killed = beside.at
        beside.until(lambda: beside.servo == NEUTRAL)
        assert beside.at - killed < 1.0 + 0.1, "FS_PILOT_TIMEOUT is 1 s"
    beside.links.close()
