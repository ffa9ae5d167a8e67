"""Lindy's driver and a real second ground station at one board, on two links of it: a script with
pymavlink and, where LINDY_MAVPROXY names it, MAVProxy. The board is the double, and the firmware
where LINDY_ARDUSUB names one.
"""

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import pytest

from messages.control import ThrusterCommand
from tests.support.ardusub_double.wire import BOARDS, DOWN, NEUTRAL, Wire, board_process
from tests.support.patience import PATIENCE_S
from tests.support.ports import free_port

pytestmark = pytest.mark.system

MAVPROXY = os.environ.get("LINDY_MAVPROXY") or shutil.which("mavproxy.py")
OTHER = 254  # its system; Lindy's is 255, as the board's parameter says
GROUND_STATION, INVALID = 6, 8  # MAV_TYPE, MAV_AUTOPILOT


class Station(Protocol):
    """A ground station beside Lindy. None of these waits."""

    def listen(self) -> bool:
        """Does it know the vehicle?"""
        ...

    def push_ahead(self) -> None: ...

    def depth_hold(self) -> None: ...

    def disarm(self) -> None: ...


class Script(Station):
    """As anybody would write it with pymavlink."""

    def __init__(self, port: int) -> None:
        from pymavlink import mavutil  # pyright: ignore[reportMissingTypeStubs]

        self.link: Any = mavutil.mavlink_connection(
            f"udpin:127.0.0.1:{port}", source_system=OTHER, source_component=190
        )
        self._next = 0.0

    def listen(self) -> bool:
        while self.link.recv_match(blocking=False) is not None:
            pass
        if self.link.target_system and time.monotonic() >= self._next:
            self._next = time.monotonic() + 1.0
            self.link.mav.heartbeat_send(GROUND_STATION, INVALID, 0, 0, 0)
        return bool(self.link.target_system)

    def push_ahead(self) -> None:
        self.link.mav.rc_channels_override_send(1, 1, *[65535] * 4, 1900, *[65535] * 3)

    def depth_hold(self) -> None:
        self.link.set_mode("ALT_HOLD")

    def disarm(self) -> None:
        self.link.arducopter_disarm()


class MavProxy(Station):
    """Without a display, its console a pipe."""

    def __init__(self, process: "subprocess.Popen[bytes]", screen: Path) -> None:
        self._process, self._screen = process, screen

    def listen(self) -> bool:
        assert self._process.poll() is None, self._screen.read_text(errors="replace")
        return "Detected vehicle" in self._screen.read_text(errors="replace")

    def push_ahead(self) -> None:
        self._tell("rc 5 1900")

    def depth_hold(self) -> None:
        self._tell("mode ALT_HOLD")

    def disarm(self) -> None:
        self._tell("disarm")

    def _tell(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode())
        self._process.stdin.flush()


@contextmanager
def station(name: str, port: int, folder: Path) -> Generator[Station]:
    if name == "script":
        script = Script(port)
        yield script
        script.link.close()
        return
    assert MAVPROXY is not None
    screen = folder / "mavproxy.txt"
    command = [MAVPROXY, f"--master=udpin:127.0.0.1:{port}", f"--source-system={OTHER}"]
    with screen.open("w") as output:
        process = subprocess.Popen(
            [*command, f"--state-basedir={folder}"],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
    try:
        yield MavProxy(process, screen)
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE_S)


def dives(wire: Wire) -> bool:
    """By Lindy's sticks: the verticals of the board as it was told to, the others at rest."""
    told = 1500 - (wire.driver.path.mixed.pulses[2] - 1500)
    flies = wire.driver.authority.flies(time.monotonic_ns())
    return flies and wire.servo == pytest.approx([1500] * 4 + [told] * 4, abs=2) and told > 1550


def disarm(wire: Wire) -> None:
    """By Lindy's own pilot."""
    now, rest = time.monotonic_ns(), (0.0,) * len(DOWN)
    wire.driver.obey(
        ThrusterCommand(stamp_ns=now, sensor_ns=None, pilot_ns=None, thrust=rest, armed=False), now
    )


@pytest.mark.parametrize(
    "name",
    [
        "script",
        pytest.param(
            "mavproxy",
            marks=pytest.mark.skipif(MAVPROXY is None, reason="no MAVProxy: set LINDY_MAVPROXY"),
        ),
    ],
)
@pytest.mark.parametrize("kind", BOARDS[1:])
def test_a_second_ground_station_and_lindy(tmp_path: Path, kind: str, name: str) -> None:
    port, beside = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    wire = Wire(port)
    with (
        board_process(kind, port, tmp_path, beside=beside),
        station(name, beside, tmp_path) as other,
    ):
        wire.wait_for(other.listen)  # it has started
        wire.flying()
        wire.wait_for(lambda: other.listen() and dives(wire))
        for _ in range(20):  # its sticks are not obeyed: the board takes those of 255
            other.push_ahead()
            wire.until(lambda: other.listen() and False, 0.05)
            assert wire.servo[:4] == NEUTRAL[:4], wire.said
        assert not wire.driver.authority.taken, wire.said

        other.depth_hold()
        wire.wait_for(lambda: other.listen() and wire.driver.authority.taken)
        assert [text for text in wire.said if "was switched to ALT_HOLD, not by Lindy" in text]
        assert not wire.driver.authority.sends_sticks
        disarm(wire)  # and armed again by the next command: it is Lindy's vehicle again
        wire.wait_for(lambda: other.listen() and dives(wire))

        other.disarm()
        wire.wait_for(lambda: other.listen() and wire.driver.authority.taken)
        wire.wait_for(lambda: other.listen() and wire.servo == NEUTRAL)
        assert [text for text in wire.said if "was disarmed, not by Lindy" in text]
        assert not [text for text in wire.said if "in Lindy" in text]
    wire.links.close()
