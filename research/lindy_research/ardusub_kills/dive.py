"""A dive at depth with the stick forward, in which one process is killed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import msgspec

from lindy_research.ardusub_comparison.firmware import firmware, free_port
from messages.events import Outbox
from services.ardusub.service import ONE_BOARD
from services.mavlink_io.io.endpoint import MavlinkEndpoint
from services.mavlink_io.io.links import Links
from services.mavlink_io.packet import MavCommand, MavlinkPacket, command
from services.runtime.config.running import RUNNING, Running

SERVICES = ("gamepad", "hub_topside", "tether", "hub_drone", "reference", "estimation", "control",
            "ardusub")  # fmt: skip
# Down, then forward: without a DVL the stick in surge is a force. Later the pilot lets go, disarms,
# arms and goes on: he must where the board was disarmed by itself or is another one.
FORWARD_S, AGAIN_S = 4.0, 30.0  # [s]
SCRIPT = f"""t,surge,sway,heave,yaw,event
0,0,0,0,0,
1,0,0,1,0,
{FORWARD_S:g},0.6,0,0,0,
{AGAIN_S:g},0,0,0,0,disarm
{AGAIN_S + 2:g},0,0,0,0,arm
{AGAIN_S + 5:g},0.6,0,0,0,
90,0,0,0,0,
"""
PATIENCE_S = 90.0  # [s] until it goes forward
STEADY_S = 4.0  # [s] of that before the kill: the ramps have ended
AFTER_S = 3.0  # [s] looked at after it
GOING = 1600  # [µs] of motor 3 or 4
REST = [1500] * 8  # [µs]
OUTPUTS, INTERVAL_US = 36, 10_000  # SERVO_OUTPUT_RAW
OBSERVER = 250  # system


class KilledService(NamedTuple):
    """Times by the board's clock [s] since the newest outputs before the kill: 10 ms uncertain."""

    stick_gone: float | None  # the horizontal motors, which the stick drove, are at 1500
    neutral: float | None  # all are
    texts: list[str]  # the board's own, of severity 4 and worse, and "Disarming motors"


class OutputsSeen(NamedTuple):
    at: float  # [s] of the board's clock
    pulses: list[int]  # [µs] per motor


class OutputObserver:
    """The outputs and texts of a firmware, on its second link."""

    def __init__(self, port: int) -> None:
        self.seen: list[OutputsSeen] = []
        self.texts: list[str] = []
        outbox = Outbox()
        self._links = Links([f"udpin:127.0.0.1:{port}"], "port", ONE_BOARD, outbox)
        self._board = MavlinkEndpoint(self._links, outbox, OBSERVER, 191)

    def close(self) -> None:
        self._links.close()

    def say(self, packet: MavlinkPacket) -> None:
        self._board.send(packet)

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        end, ask = time.monotonic() + seconds, 0.0
        while not condition():
            if (now := time.monotonic()) > end:
                return False
            if now > ask:
                ask = now + 1.0
                asked = command(1, MavCommand.SET_MESSAGE_INTERVAL, OUTPUTS, INTERVAL_US)
                self._board.send(asked)
            self._read()
            time.sleep(0.001)  # the board is a process in real time
        return True

    def run(self, seconds: float) -> None:
        self.until(lambda: False, seconds)

    def _read(self) -> None:
        for packet in self._board.receive():
            if packet.name == "SERVO_OUTPUT_RAW":
                pulses = [packet.fields[f"servo{n}_raw"] for n in range(1, 9)]
                self.seen.append(OutputsSeen(packet.fields["time_usec"] / 1e6, pulses))
            elif packet.name == "STATUSTEXT":
                text = str(packet.fields["text"])
                if packet.fields["severity"] <= 4 or text == "Disarming motors":
                    self.texts.append(text)


def kill_in_a_dive(path: str, service: str, folder: Path) -> KilledService:
    """
    Args:
        path: of the firmware.
        service: one of SERVICES.
        folder: a new one.

    Raises:
        RuntimeError: it does not fly.
    """
    port, second = free_port(), free_port()
    folder.mkdir(parents=True)
    observer = OutputObserver(second)
    with firmware(path, port, second, folder / "board"), dive_on(port, folder):
        going = observer.until(lambda: goes(observer), PATIENCE_S)
        if not going:
            said = (folder / "dive.log").read_text()
            raise RuntimeError(f"it does not fly:\n{said}")
        observer.run(STEADY_S)
        running = msgspec.json.decode((folder / "out" / RUNNING).read_bytes(), type=Running)
        os.kill(running.pids[service], signal.SIGKILL)
        killed, texts = observer.seen[-1].at, len(observer.texts)
        observer.run(AFTER_S)
    observer.close()
    after = [seen for seen in observer.seen if seen.at > killed]
    stick_gone = _first(after, lambda seen: seen.pulses[:4] == REST[:4])
    neutral = _first(after, lambda seen: seen.pulses == REST)
    return KilledService(
        None if stick_gone is None else stick_gone - killed,
        None if neutral is None else neutral - killed,
        observer.texts[texts:],
    )


def goes(observer: OutputObserver) -> bool:
    return bool(observer.seen) and max(observer.seen[-1].pulses[2:4]) > GOING


def _first(rows: list[OutputsSeen], condition: Callable[[OutputsSeen], bool]) -> float | None:
    return next((seen.at for seen in rows if condition(seen)), None)


@contextmanager
def dive_on(port: int, folder: Path) -> Generator[None]:
    """Lindy as processes; everything is ended when the block is left."""
    script = folder / "sticks.csv"
    script.write_text(SCRIPT)
    said = [sys.executable, "-P", "-m", "tools", "dive", "--stack", "ardusub", "--headless"]
    said += ["--vehicle", "bluerov2_heavy", "--pilot", f"script:{script}"]
    said += ["--set", f"ardusub.url=udpin:127.0.0.1:{port}", "--out", str(folder / "out")]
    said += ["--set", "estimation.calibration.still_time=3"]
    with (folder / "dive.log").open("wb") as log:
        dive = subprocess.Popen(said, start_new_session=True, stdout=log, stderr=log)
        try:
            yield
        finally:
            os.killpg(dive.pid, signal.SIGKILL)
            dive.wait()
