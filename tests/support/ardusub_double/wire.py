"""The driver for ArduSub alone on a real socket, and a board that is a process: the double, or a
firmware in its simulator, where LINDY_ARDUSUB names its executable."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from messages.control import ThrusterCommand
from messages.events import Outbox
from services.ardusub.core import ArdusubDriver, Settings
from services.ardusub.service import ONE_BOARD
from services.marine.vehicle import Vehicle
from services.mavlink_io.io.endpoint import MavlinkEndpoint
from services.mavlink_io.io.links import Links
from services.mavlink_io.packet import MavCommand, MavlinkPacket, command
from services.runtime.config.stack import Stack
from tests.support.patience import PATIENCE_S

DOUBLE = "tests.support.ardusub_double.udp"
FIRMWARE = [path for path in os.environ.get("LINDY_ARDUSUB", "").split(":") if path]
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
NEUTRAL = [1500] * 8  # [µs]
DOWN = (0.0, 0.0, 0.0, 0.0, 6.0, 6.0, 6.0, 6.0)  # [N]
BOARDS = ["4.8", *(FIRMWARE or [NO_FIRMWARE])]


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
        beside: port of a second link of a firmware.
        model: of a firmware's simulator.
    """
    values = params or {}
    if kind in ("4.5", "4.8"):
        said = [sys.executable, "-P", "-m", DOUBLE, "--to", str(port), "--version", kind]
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
    return Path(__file__).parents[3] if kind in ("4.5", "4.8") else folder


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
