"""The stack as processes, in real time, over UDP on 127.0.0.1, with a board that is a process too.

The board is the double; and ArduSub's own firmware in its simulator, where LINDY_ARDUSUB names its
executable (several are separated by colons).
"""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.sensors import ImuSample, PressureSample
from messages.state import VehicleState
from services.ardusub.core import ArdusubDriver, Settings
from services.ardusub.service import ONE_BOARD
from services.marine.vehicle import Vehicle
from services.mavlink_io.io.endpoint import MavlinkEndpoint
from services.mavlink_io.io.links import Links
from services.mavlink_io.packet import MavCommand, MavlinkPacket, command
from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import Stack
from tests.support.patience import PATIENCE_S, until
from tests.support.ports import free_port
from tools.recordings.recording import open_recording
from tools.report import read_dive

DOUBLE = "tests.support.ardusub_double.udp"
FIRMWARE = [path for path in os.environ.get("LINDY_ARDUSUB", "").split(":") if path]
SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.8,0\n5,0,0,0,0\n9,0,0,0,0\n"
S = 1_000_000_000  # [ns]
# Of the simulator that comes with the firmware: no RC receiver, as on every tethered ROV, and
# sensors without the noise that no water has, and a compass with that of every compass.
DEFAULTS = """FRAME_CONFIG 2
SIM_RC_FAIL 1
SIM_BARO_RND 0.002
SIM_BAR2_RND 0.002
SIM_MAG_RND 3
FS_PILOT_TIMEOUT 1
"""
NO_FIRMWARE = pytest.param("", marks=pytest.mark.skip("LINDY_ARDUSUB names no firmware"))
# The double's 4.5 is flown on virtual time: test_ardusub.py
BOARDS = ["4.8", *(FIRMWARE or [NO_FIRMWARE])]
THRUSTER = "[[vehicle.thruster]]"


@contextmanager
def board_process(
    kind: str,
    port: int,
    folder: Path,
    params: dict[str, float] | None = None,
    beside: int = 0,
    model: str = "vectored_6dof",
) -> Generator[None]:
    """The double of a version, or a firmware by its path, which calls this port.

    Args:
        params: besides those above.
        beside: port of a second link.
        model: of a firmware's simulator.
    """
    values = params or {}
    if kind in ("4.5", "4.8"):
        said = [sys.executable, "-P", "-m", DOUBLE, "--to", str(port), "--version", kind]
        said += ["--beside", str(beside)] if beside else []
        said += [word for name, value in values.items() for word in ("--set", f"{name}={value}")]
    else:
        (folder / "lindy.parm").write_text(
            DEFAULTS + "".join(f"{name} {value:g}\n" for name, value in values.items())
        )
        said = [kind, "--model", model, "-S", "-I0", "--home", "63.4,10.4,0,90"]
        said += ["--defaults", "lindy.parm", "--serial0", f"udpclient:127.0.0.1:{port}"]
        said += ["--serial2", "none:"]  # else port 5763, which another one beside may have
        said += ["--serial1", f"udpclient:127.0.0.1:{beside}"] if beside else []
    with (folder / "board.log").open("wb") as log:
        process = subprocess.Popen(said, cwd=_root(kind, folder), stdout=log, stderr=log)
        try:
            yield
        finally:
            process.kill()
            process.wait()


def _root(kind: str, folder: Path) -> Path:
    """The firmware writes its memory into the folder that it runs in."""
    return Path(__file__).parents[2] if kind in ("4.5", "4.8") else folder


@pytest.fixture
def port() -> int:
    return free_port(socket.SOCK_DGRAM)


class Wire:
    """The driver alone on a real socket, with everything that the board says."""

    def __init__(self, port: int) -> None:
        stack = Stack(vehicle="bluerov2_heavy")
        self.outbox = Outbox()
        self.links = Links([f"udpin:127.0.0.1:{port}"], "url", ONE_BOARD, self.outbox)
        self.driver = ArdusubDriver(stack.section("vehicle", Vehicle), Settings(), self.outbox)
        self.board = MavlinkEndpoint(self.links, self.outbox, 255, 191)
        self.other = MavlinkEndpoint(self.links, self.outbox, 254, 190)
        self.thrust: tuple[float, ...] | None = None
        self.alive = True  # the service
        self.texts: list[str] = []
        self.said: list[str] = []
        self.servo: list[int] = []  # [µs] of the newest SERVO_OUTPUT_RAW
        self.samples: list[tuple[int, object]] = []

    def until(self, condition: Callable[[], bool], seconds: float = PATIENCE_S) -> float:
        """[s] until then; infinite where it does not come."""
        began, next_command = time.monotonic_ns(), 0
        while (passed := time.monotonic_ns() - began) < seconds * S:
            self._hear()
            now = time.monotonic_ns()
            if self.alive and self.thrust is not None and now >= next_command:
                next_command = now + 10_000_000
                self.driver.obey(self._command(self.thrust, now), now)
            if self.driver.path.gate.ends_ns is not None and now > self.driver.path.gate.ends_ns:
                self.driver.lapse(now)
            if self.alive:
                self.driver.tick(now)
            self._pass_on(now)
            if condition():
                return passed / S
            time.sleep(0.002)  # the board is a process in real time
        return float("inf")

    def wait_for(self, condition: Callable[[], bool]) -> None:
        assert self.until(condition) < PATIENCE_S, (self.servo, self.said)

    def run(self, seconds: float) -> None:
        self.until(lambda: False, seconds)

    def say(self, packet: MavlinkPacket) -> None:
        self.board.send(packet)

    def another_says(self, packet: MavlinkPacket) -> None:
        """A ground station beside us."""
        self.other.send(packet)

    def flying(self) -> None:
        self.wait_for(lambda: self.driver.stage == "accepted")
        self.say(command(1, MavCommand.SET_MESSAGE_INTERVAL, 36, 10_000))
        self.thrust = DOWN
        self.wait_for(lambda: self.armed and bool(self.servo) and self.servo != NEUTRAL)

    @property
    def armed(self) -> bool:
        return self.driver.authority.board_armed

    def _hear(self) -> None:
        packets = self.board.receive()
        now = time.monotonic_ns()
        for packet in packets:
            self.driver.hear(packet, now)
            if packet.name == "STATUSTEXT":
                self.texts.append(packet.fields["text"])
            if packet.name == "SERVO_OUTPUT_RAW":
                self.servo = [packet.fields[f"servo{n}_raw"] for n in range(1, 9)]

    def _pass_on(self, now: int) -> None:
        done = self.driver.take()
        self.said += [text for _, text, _ in self.outbox.said]
        self.outbox.said.clear()
        self.samples += [(now, sample) for sample in done.samples]
        if self.alive:
            for packet in done.packets:
                self.say(packet)

    def _command(self, thrust: tuple[float, ...], now: int) -> ThrusterCommand:
        return ThrusterCommand(
            stamp_ns=now, sensor_ns=None, pilot_ns=None, thrust=thrust, armed=True
        )


NEUTRAL = [1500] * 8
DOWN = (0.0, 0.0, 0.0, 0.0, 6.0, 6.0, 6.0, 6.0)  # [N]


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.parametrize("kind", BOARDS)
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
    script, out = folder / "script.csv", folder / "out"
    script.write_text(SCRIPT)
    command = [sys.executable, "-P", "-m", "tools", "dive", "--stack", "ardusub", "--headless"]
    command += ["--vehicle", vehicle, "--pilot", f"script:{script}", "--out", str(out)]
    told = (f"ardusub.url=udpin:127.0.0.1:{port}", "estimation.calibration.still_time=3")
    for assignment in (*told, *overrides):
        command += ["--set", assignment]
    said = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert said.returncode == 0, said.stdout + said.stderr
    return out


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
@pytest.mark.parametrize("kind", BOARDS)
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
    script = tmp_path / "script.csv"
    script.write_text("t,surge,sway,heave,yaw\n0,0,0,1,0\n60,0,0,0,0\n")
    words = [sys.executable, "-P", "-m", "tools", "dive", "--stack", "ardusub", "--headless"]
    words += ["--vehicle", "bluerov2_heavy", "--pilot", f"script:{script}"]
    words += ["--set", f"ardusub.url=udpin:127.0.0.1:{port}", "--out", str(tmp_path / "out")]
    words += ["--set", "estimation.calibration.still_time=3"]
    beside = Beside(second)
    with board_process(kind, port, tmp_path, beside=second):
        dive = subprocess.Popen(words, start_new_session=True, stdout=subprocess.DEVNULL)
        try:
            beside.until(lambda: max(beside.servo, default=0) > 1600)
        finally:
            os.killpg(dive.pid, signal.SIGKILL)  # as when its computer dies
            dive.wait()
        killed = beside.at
        beside.until(lambda: beside.servo == NEUTRAL)
        assert beside.at - killed < 1.0 + 0.1, "FS_PILOT_TIMEOUT is 1 s"
    beside.links.close()
