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
from messages.sensors import ImuSample, PressureSample
from services.ardusub.core import ArdusubDriver, Settings
from services.ardusub.io.codec import BoardCodec, FrameReader
from services.ardusub.io.link import open_link
from services.ardusub.packet import SET_INTERVAL, MavlinkPacket, command
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from tools.recordings.recording import open_recording
from tools.report import read_dive
from tools.research.ardusub_kills.dive import kill_in_a_dive

DOUBLE = "tools.research.ardusub_double.udp"
FIRMWARE = [path for path in os.environ.get("LINDY_ARDUSUB", "").split(":") if path]
SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.8,0\n5,0,0,0,0\n9,0,0,0,0\n"
S = 1_000_000_000  # [ns]
PATIENCE_S = 120.0  # for a slow and busy computer
# Of the simulator that comes with the firmware: no RC receiver, as on every tethered ROV, and
# sensors without the noise that no water has, and a compass with that of every compass.
DEFAULTS = """FRAME_CONFIG 2
SIM_RC_FAIL 1
SIM_BARO_RND 0.002
SIM_BAR2_RND 0.002
SIM_MAG_RND 3
FS_PILOT_TIMEOUT 1
"""
BOARDS = [
    "4.8",  # the double's 4.5 is flown on virtual time: test_ardusub.py
    *(FIRMWARE or [pytest.param("", marks=pytest.mark.skip("LINDY_ARDUSUB names no firmware"))]),
]


@contextmanager
def board_process(
    kind: str, port: int, folder: Path, params: dict[str, float] | None = None, beside: int = 0
) -> Generator[None]:
    """The double of a version, or a firmware by its path, which calls this port.

    Args:
        params: besides those above.
        beside: port of a second link.
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
        said = [kind, "--model", "vectored_6dof", "-S", "-I0", "--home", "63.4,10.4,0,90"]
        said += ["--defaults", "lindy.parm", "--serial0", f"udpclient:127.0.0.1:{port}"]
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
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Wire:
    """The driver alone on a real socket, with everything that the board says."""

    def __init__(self, port: int) -> None:
        stack = Stack(vehicle="bluerov2_heavy")
        self.link = open_link(f"udpin:127.0.0.1:{port}")
        self.driver = ArdusubDriver(stack.section("vehicle", Vehicle), Settings())
        self.codec = BoardCodec(255, 191)
        self.other = BoardCodec(254, 190)
        self.reader = FrameReader(self.codec)
        self.thrust: tuple[float, ...] | None = None
        self.alive = True  # the service
        self.texts: list[str] = []
        self.said: list[str] = []
        self.servo: list[int] = []  # [µs] of the newest SERVO_OUTPUT_RAW
        self.samples: list[tuple[int, object]] = []

    def until(self, condition: Callable[[], bool], seconds: float = 30.0) -> float:
        """[s] until then; infinite where it does not come."""
        began, next_command = time.monotonic_ns(), 0
        while (passed := time.monotonic_ns() - began) < seconds * S:
            self._hear()
            now = time.monotonic_ns()
            if self.alive and self.thrust is not None and now >= next_command:
                next_command = now + 10_000_000
                self.driver.obey(self._command(self.thrust, now), now)
            if self.driver.ends_ns is not None and now > self.driver.ends_ns:
                self.driver.lapse(now)
            if self.alive:
                self.driver.tick(now)
            self._pass_on(now)
            if condition():
                return passed / S
            time.sleep(0.002)  # the board is a process in real time
        return float("inf")

    def run(self, seconds: float) -> None:
        self.until(lambda: False, seconds)

    def say(self, packet: MavlinkPacket) -> None:
        self.link.send(self.codec.encode(packet))

    def another_says(self, packet: MavlinkPacket) -> None:
        """A ground station beside us."""
        self.link.send(self.other.encode(packet))

    def flying(self) -> None:
        assert self.until(lambda: self.driver.stage == "accepted", 60.0) < 60.0, self.said
        self.say(command(1, SET_INTERVAL, 36, 10_000))
        self.thrust = DOWN
        moves = self.until(lambda: self.armed and bool(self.servo) and self.servo != NEUTRAL)
        assert moves < 30.0, self.said

    @property
    def armed(self) -> bool:
        return self.driver.authority.board_armed

    def _hear(self) -> None:
        found = self.reader.read(b"".join(self.link.receive()))
        now = time.monotonic_ns()
        for packet in found.packets:
            self.driver.hear(packet, now)
            if packet.name == "STATUSTEXT":
                self.texts.append(packet.fields["text"])
            if packet.name == "SERVO_OUTPUT_RAW":
                self.servo = [packet.fields[f"servo{n}_raw"] for n in range(1, 9)]

    def _pass_on(self, now: int) -> None:
        done = self.driver.take()
        self.said += [text for _, text in done.lines]
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


@pytest.mark.system
@pytest.mark.parametrize("kind", BOARDS)
def test_the_driver_alone_on_the_wire(tmp_path: Path, kind: str, port: int) -> None:
    wire = Wire(port)
    with board_process(kind, port, tmp_path):
        assert wire.until(lambda: wire.driver.stage == "accepted", 60.0) < 60.0, wire.said
        wire.run(3.0)
        imu = [m for _, m in wire.samples if isinstance(m, ImuSample)]
        assert len(imu) > 200
        assert imu[-1].specific_force[2] == pytest.approx(-9.81, abs=0.5)
        assert [m for _, m in wire.samples if isinstance(m, PressureSample)]
        wire.say(command(1, SET_INTERVAL, 36, 10_000))
        wire.thrust = DOWN
        assert wire.until(lambda: wire.armed, 10.0) < 10.0, wire.said
        assert wire.until(lambda: bool(wire.servo) and wire.servo != NEUTRAL) < 5.0, wire.said
        wire.run(0.5)
        expected = 1500 - (wire.driver.mixed.pulses[2] - 1500)
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
    wire.link.close()


@pytest.mark.system
@pytest.mark.parametrize("kind", BOARDS)
def test_a_dive_as_processes(tmp_path: Path, kind: str, port: int) -> None:
    script, out = tmp_path / "script.csv", tmp_path / "out"
    script.write_text(SCRIPT)
    command = [sys.executable, "-P", "-m", "tools", "dive", "--stack", "ardusub"]
    command += ["--vehicle", "bluerov2_heavy", "--pilot", f"script:{script}", "--headless"]
    command += ["--set", f"ardusub.url=udpin:127.0.0.1:{port}", "--out", str(out)]
    command += ["--set", "estimation.calibration.still_time=3"]
    with board_process(kind, port, tmp_path):
        said = subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
    assert said.returncode == 0, said.stdout + said.stderr
    report = json.loads((out / "report.json").read_text())
    assert report["exit"] == "clean"
    assert report["services"]["ardusub"]["restarts"] == 0
    assert (read_dive(open_recording(out)).max_depth_m or 0.0) > 0.3


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
        assert wire.until(lambda: wire.driver.authority.taken, 10.0) < 10.0
        if wanted == "disarm":
            assert wire.until(lambda: wire.servo == NEUTRAL, 10.0) < 10.0
        assert [text for text in wire.said if "somebody else has it" in text]
        assert not wire.driver.authority.sends_sticks
        wire.run(3.0)  # in which it would have armed again, or set the mode back
        assert wire.driver.authority.taken
        if wanted == "disarm":
            assert not wire.armed
            assert wire.servo == NEUTRAL
    wire.link.close()


@pytest.mark.system
@pytest.mark.parametrize("kind", BOARDS)
def test_a_board_with_a_wrong_parameter_is_not_armed(tmp_path: Path, kind: str, port: int) -> None:
    wire = Wire(port)
    with board_process(kind, port, tmp_path, {"FS_PILOT_INPUT": 0.0}):
        wire.thrust = DOWN
        assert wire.until(lambda: wire.driver.stage == "refused", 60.0) < 60.0, wire.said
        assert [text for text in wire.said if "FS_PILOT_INPUT is 0; allowed: 2" in text]
        wire.run(3.0)
        assert not wire.armed
        assert not [sample for _, sample in wire.samples]
    wire.link.close()


class Beside:
    """The outputs of a firmware, on its second link, by the board's own clock."""

    def __init__(self, port: int) -> None:
        self.link = open_link(f"udpin:127.0.0.1:{port}")
        self.codec = BoardCodec(250, 191)
        self.reader = FrameReader(self.codec)
        self.at, self.servo = 0.0, list[int]()  # [s] and [µs] of the newest

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        end, ask = time.monotonic() + seconds, 0.0
        while not condition():
            if (now := time.monotonic()) > end:
                return False
            if now > ask:
                ask = now + 1.0
                self.link.send(self.codec.encode(command(1, SET_INTERVAL, 36, 10_000)))
            for packet in self.reader.read(b"".join(self.link.receive())).packets:
                if packet.name == "SERVO_OUTPUT_RAW" and not condition():
                    self.at = packet.fields["time_usec"] / 1e6
                    self.servo = [packet.fields[f"servo{n}_raw"] for n in range(1, 9)]
            time.sleep(0.001)  # the board is a process in real time
        return True


@pytest.mark.system
@pytest.mark.parametrize(
    "kind", FIRMWARE or [pytest.param("", marks=pytest.mark.skip("LINDY_ARDUSUB is not set"))]
)
def test_when_all_of_lindy_is_killed_the_board_is_neutral_after_its_timeout(
    tmp_path: Path, kind: str, port: int
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        second = probe.getsockname()[1]
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
            assert beside.until(lambda: max(beside.servo, default=0) > 1600, PATIENCE_S)
        finally:
            os.killpg(dive.pid, signal.SIGKILL)  # as when its computer dies
            dive.wait()
        killed = beside.at
        assert beside.until(lambda: beside.servo == NEUTRAL, 30.0)
        assert beside.at - killed < 1.0 + 0.1, "FS_PILOT_TIMEOUT is 1 s"
    beside.link.close()


@pytest.mark.system
@pytest.mark.parametrize("service", ["control", "estimation", "hub_drone", "ardusub"])
@pytest.mark.parametrize(
    "kind", FIRMWARE or [pytest.param("", marks=pytest.mark.skip("LINDY_ARDUSUB is not set"))]
)
def test_when_a_service_is_killed_the_outputs_are_neutral_in_its_time(
    tmp_path: Path, kind: str, service: str
) -> None:
    found = kill_in_a_dive(kind, service, tmp_path / "dive")
    own = service == "ardusub"  # nobody is left but the board
    most = 1.0 if own else 0.2  # [s] FS_PILOT_TIMEOUT, or the life of a command
    assert found.neutral is not None
    assert found.neutral <= most + 0.1
    assert ("Lost manual control" in found.texts) == own
