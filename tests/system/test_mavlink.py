"""Programs that are not ours fly the simulated vehicle in real time: pymavlink over UDP, MAVProxy
over TCP. MAVProxy is found by the environment variable LINDY_MAVPROXY, else on the PATH."""

import os
import re
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.support.doors import free_port
from tests.support.patience import PATIENCE_S, until
from tests.support.started import Started

pytestmark = pytest.mark.system

ARM_DISARM = 400
PERIOD_S = 0.04  # [s] of a ground station's sticks
AGAIN_S = 5.0  # [s] until a person at a ground station asks again
MAVPROXY = os.environ.get("LINDY_MAVPROXY") or shutil.which("mavproxy.py")


class LinkedDive(Started):
    """`lindy dive --stack mavlink`, with links of its own."""

    def __init__(self, folder: Path) -> None:
        self.udp, self.tcp = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_STREAM)
        links = f'["udpout:127.0.0.1:{self.udp}", "tcpin:127.0.0.1:{self.tcp}"]'
        words = ("dive", "--stack", "mavlink", "--headless", "--set", f"mavlink.links={links}")
        super().__init__(folder / "dive", *words)


@pytest.fixture(scope="module")
def dive(tmp_path_factory: pytest.TempPathFactory) -> Generator[LinkedDive]:
    with LinkedDive(tmp_path_factory.mktemp("mavlink")) as dive:
        yield dive


class Script:
    """A pilot's script, as anybody would write it with pymavlink."""

    def __init__(self, address: str) -> None:
        from pymavlink import mavutil  # pyright: ignore[reportMissingTypeStubs]

        self.vehicle: Any = mavutil.mavlink_connection(
            address, source_system=255, source_component=190
        )
        self.texts: list[str] = []
        self.acks: list[tuple[int, int]] = []

    def listen(self) -> None:
        while (message := self.vehicle.recv_match(blocking=False)) is not None:
            if message.get_type() == "STATUSTEXT":
                self.texts.append(message.text)
            elif message.get_type() == "COMMAND_ACK":
                self.acks.append((message.command, message.result))

    def until(self, happens: Callable[[], object], *, steers: bool = True, z: int = 500) -> None:
        """Send sticks until something has happened."""

        def fly() -> None:
            if steers:
                self.vehicle.mav.manual_control_send(1, 0, 0, z, 0, 0)
            time.sleep(PERIOD_S)
            self.listen()

        until(happens, lambda: (self.texts, self.acks), fly)

    def for_s(self, seconds: float, z: int = 500, *, steers: bool = True) -> None:
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, z=z, steers=steers)

    def dive_to(self, depth: float) -> None:
        """[m] A computer that stands still makes a failsafe act; a person resumes then."""
        while not self.depth > depth:
            self.until(lambda: self.depth > depth or self.stopped, z=0)
            if self.stopped:
                self.vehicle.set_mode("ALT_HOLD")
                self.for_s(1.0)

    def arm(self, arm: int) -> None:
        self.vehicle.mav.command_long_send(1, 1, ARM_DISARM, 0, arm, 0, 0, 0, 0, 0, 0)

    def acknowledged(self, number: int, result: int) -> Callable[[], bool]:
        self.acks.clear()
        return lambda: (number, result) in self.acks

    @property
    def depth(self) -> float:
        """[m]"""
        return -self.vehicle.messages["GLOBAL_POSITION_INT"].relative_alt / 1000

    @property
    def stopped(self) -> bool:
        """A failsafe acts."""
        return self.vehicle.messages["HEARTBEAT"].system_status == 5

    @property
    def ready(self) -> bool:
        return self.vehicle.messages["HEARTBEAT"].system_status == 3


def parameters(vehicle: Any) -> dict[str, float]:
    """All of them; asked for again, as ground stations do, when none come any more."""
    values: dict[str, float] = {}

    def complete() -> bool:
        vehicle.mav.param_request_list_send(1, 1)
        while True:
            value = vehicle.recv_match(type="PARAM_VALUE", blocking=True, timeout=3.0)
            if value is None:
                return False
            values[value.param_id] = value.param_value
            if len(values) == value.param_count:
                return True

    until(complete, lambda: values)
    return values


@pytest.mark.slow
def test_a_pymavlink_script_flies_over_udp(dive: LinkedDive) -> None:
    script = Script(f"udpin:127.0.0.1:{dive.udp}")
    vehicle = script.vehicle
    assert vehicle.wait_heartbeat(timeout=PATIENCE_S) is not None, dive.said
    assert (vehicle.target_system, vehicle.mav_type, vehicle.flightmode) == (1, 12, "ALT_HOLD")
    assert parameters(vehicle)["FS_PILOT_TIMEOUT"] == pytest.approx(0.3)

    script.until(lambda: script.ready)
    script.for_s(0.2)
    script.arm(1)
    script.until(script.acknowledged(ARM_DISARM, 0))
    script.until(vehicle.motors_armed)
    start = script.depth
    script.dive_to(start + 1.0)
    script.for_s(3.0)
    held = script.depth
    script.for_s(2.0)
    assert abs(script.depth - held) < 0.15

    vehicle.set_mode("MANUAL")
    script.until(lambda: vehicle.flightmode == "MANUAL")
    vehicle.set_mode("ALT_HOLD")
    script.until(lambda: vehicle.flightmode == "ALT_HOLD")

    script.until(lambda: "failsafe: pilot lost" in script.texts, steers=False)
    script.until(lambda: script.stopped, steers=False)
    assert vehicle.motors_armed()
    script.for_s(2.5, steers=False)  # so long that centred sticks are not enough any more
    script.for_s(1.5)  # a heartbeat comes once a second
    assert script.stopped, "sticks alone end no failsafe"
    vehicle.set_mode("ALT_HOLD")
    script.until(lambda: vehicle.messages["HEARTBEAT"].system_status == 4)
    script.arm(0)
    script.until(script.acknowledged(ARM_DISARM, 0))
    script.until(lambda: not vehicle.motors_armed())
    vehicle.mav.rc_channels_override_send(1, 1, *[0] * 8)  # lets go of the sticks
    vehicle.close()


class MavProxy:
    """MAVProxy without a display, its console a pipe."""

    def __init__(self, process: subprocess.Popen[bytes], screen: Path) -> None:
        self._process, self._screen = process, screen

    def tell(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode())
        self._process.stdin.flush()

    def until(self, says: str, times: int = 1) -> None:
        until(
            lambda: len(re.findall(says, self._said())) >= times, self._said, self._require_running
        )

    def insist(self, line: str, says: str, times: int = 1) -> None:
        """Told again every few seconds: a busy drone refuses to arm, and a station asks again."""
        told_s = -AGAIN_S

        def tell() -> None:
            nonlocal told_s
            self._require_running()
            if time.monotonic() > told_s + AGAIN_S:
                told_s = time.monotonic()
                self.tell(line)

        until(lambda: len(re.findall(says, self._said())) >= times, self._said, tell)

    def _said(self) -> str:
        return self._screen.read_text(errors="replace")

    def _require_running(self) -> None:
        assert self._process.poll() is None, self._said()


@contextmanager
def mavproxy(folder: Path, port: int) -> Generator[MavProxy]:
    assert MAVPROXY is not None
    screen = folder / "mavproxy.txt"
    command = [MAVPROXY, f"--master=tcp:127.0.0.1:{port}", f"--state-basedir={folder}"]
    with screen.open("w") as output:
        process = subprocess.Popen(
            command, cwd=folder, stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT
        )
    try:
        yield MavProxy(process, screen)
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE_S)


@pytest.mark.slow
@pytest.mark.skipif(MAVPROXY is None, reason="no MAVProxy: set LINDY_MAVPROXY to mavproxy.py")
def test_mavproxy_flies_over_tcp(dive: LinkedDive, tmp_path: Path) -> None:
    with mavproxy(tmp_path, dive.tcp) as proxy:
        proxy.until(r"Received \d+ parameters")
        proxy.tell("arm throttle")
        proxy.until("no stick positions arrive; first send MANUAL_CONTROL")
        proxy.tell("rc 3 1500")
        proxy.insist("arm throttle", r"(?<!DIS)ARMED")
        proxy.insist("mode MANUAL", "Mode MANUAL")
        proxy.insist("mode ALT_HOLD", "Mode ALT_HOLD", times=2)
        proxy.tell("rc 3 1600")
        proxy.tell("param set JS_GAIN_DEFAULT 0.75")
        proxy.tell("rc 3 1500")
        proxy.insist("disarm", "DISARMED")
