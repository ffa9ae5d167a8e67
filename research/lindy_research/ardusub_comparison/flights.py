"""The two flights: Lindy through services/ardusub, and ArduSub's ALT_HOLD by override."""

import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from lindy_research.ardusub_comparison.firmware import TruthObserver, firmware, free_port
from lindy_research.ardusub_comparison.releases import JudgedRelease, TrueDepth, judge
from lindy_research.ardusub_comparison.sticks import StickMove, heave_at
from messages import topics
from messages.pilot import PilotCommand
from services.mavlink_io.io.codec import FrameReader, MavlinkCodec
from services.mavlink_io.numbers import MavCommand, MavModeFlag
from services.mavlink_io.packet import MavlinkPacket, command, heartbeat
from services.runtime.config.settings import deploy_file
from tools.recordings.recording import open_recording

ALT_HOLD = 2
STICK_S = 0.02  # [s] between two overrides
PATIENCE_S = 90.0  # [s] until armed
SETTLE_S = 10.0  # [s] at the surface before arming, for the board's own estimator
# The drone of the firmware's simulator: 10.5 kg, no added mass, 1 N of buoyancy, and in heave
# 68.8 N s²/m² of drag. Its motors are quadratic and have no lag; from a command to them 14 ms pass,
# and its depth sensor is not averaged. The rest is that of bluerov2_heavy, with gains
# by the rule of that file: kp = M ω², kd = 2 ζ ω M, ki = kp / 5 s, ω = 5 rad/s.
MOTORS = {
    'curve = "t200"': 'curve = "ardusub_simulator"',
    "max_thrust = 30.4": "max_thrust = 51.48",
    "dead_band = 0.87": "dead_band = 0.202",
    "time_constant = 0.029": "time_constant = 0.014",
    "lag = {": "# lag = {",
}
LINDY = (
    "vehicle.mass=10.5",
    "vehicle.net_buoyancy=1.0",
    "vehicle.added_mass=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
    "vehicle.linear_damping=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
    "vehicle.quadratic_damping=[48.2, 61.9, 68.8, 1.19, 0.47, 1.5]",
    "control.depth.kp=262.0",
    "control.depth.kd=100.0",
    "control.depth.ki=52.0",
    "reference.heave.max_velocity=0.97",
    "reference.heave.max_acceleration=1.2",
    "reference.heave.jerk=4.0",
    "reference.heave.stop_acceleration=3.0",
    "reference.heave.stop_jerk=12.0",
    "estimation.calibration.still_time=3",
    "ardusub.pressure_age=0.0",
)


class Flight(NamedTuple):
    """What was found in one flight."""

    name: str
    truth: TrueDepth
    releases: list[JudgedRelease]


def fly_lindy(path: str, moves: Sequence[StickMove], folder: Path) -> Flight:
    """
    Raises:
        RuntimeError: the dive does not end in order.
    """
    port, truth_port, out = free_port(), free_port(), folder / "dive"
    folder.mkdir(parents=True)
    script = folder / "sticks.csv"
    rows = [f"{move.at:g},0,0,{move.heave:g},0" for move in moves]
    script.write_text("\n".join(["t,surge,sway,heave,yaw", *rows]) + "\n")
    said = [sys.executable, "-P", "-m", "tools", "dive", "--stack", "ardusub", "--headless"]
    vehicle = _vehicle_file(folder)
    said += ["--vehicle", str(vehicle), "--pilot", f"script:{script}", "--out", str(out)]
    for assignment in (f"ardusub.url=udpin:127.0.0.1:{port}", *LINDY):
        said += ["--set", assignment]
    observer = TruthObserver(truth_port)
    with firmware(path, port, truth_port, folder / "board"):
        done = subprocess.run(said, capture_output=True, text=True, check=False)
    truth = observer.close()
    if done.returncode != 0:
        raise RuntimeError(f"Lindy's dive failed:\n{done.stdout}{done.stderr}")
    return _judged("Lindy", truth, _commanded(out))


def _vehicle_file(folder: Path) -> Path:
    """bluerov2_heavy with the motors of the firmware's simulator."""
    text = deploy_file("vehicles", "bluerov2_heavy").read_text()
    for ours, theirs in MOTORS.items():
        text = text.replace(ours, theirs)
    path = folder / "ardusub_simulator.toml"
    path.write_text(text)
    return path


def _commanded(out: Path) -> list[tuple[float, float]]:
    """[s] UTC and heave stick, as the drone heard it."""
    found = list[tuple[float, float]]()
    recording = open_recording(out)
    for raw in recording.raw():
        if raw.key == topics.PILOT_COMMAND.key:
            message = recording.decode(raw)
            if isinstance(message, PilotCommand):
                found.append((raw.log_ns / 1e9, message.heave))
    return found


def fly_alt_hold(path: str, moves: Sequence[StickMove], folder: Path) -> Flight:
    """
    Raises:
        RuntimeError: the board does not arm.
    """
    port, truth_port = free_port(), free_port()
    observer, sent = TruthObserver(truth_port), list[tuple[float, float]]()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
        firmware(path, port, truth_port, folder / "board"),
    ):
        link.bind(("127.0.0.1", port))
        link.settimeout(0.002)
        station = _PlainStation(link)
        station.wait_until_armed()
        began = time.monotonic()
        while (t := time.monotonic() - began) < moves[-1].at:
            heave = heave_at(list(moves), t)
            sent.append((time.time(), heave))
            station.steer(heave)
    return _judged("ALT_HOLD", observer.close(), sent)


class _PlainStation:
    """A ground station that does as little as it can."""

    def __init__(self, link: socket.socket) -> None:
        self._link, self._codec = link, MavlinkCodec(255, 190)
        self._reader = FrameReader(self._codec)
        self._board: tuple[str, int] | None = None
        self._armed, self._alive, self._due = False, 0.0, 0.0

    def wait_until_armed(self) -> None:
        began = asked = time.monotonic()
        while not self._armed:
            self.steer(0.0)
            now = time.monotonic()
            if now - began > PATIENCE_S:
                raise RuntimeError("the board does not arm")
            if now - began > SETTLE_S and now - asked > 1.0:
                asked = now
                self._send(command(1, MavCommand.DO_SET_MODE, 1, ALT_HOLD))
                self._send(command(1, MavCommand.COMPONENT_ARM_DISARM, 1))

    def steer(self, heave: float) -> None:
        """Sticks now, then hear the board until the next are due."""
        pulses = {f"chan{n}_raw": 1500 for n in range(1, 7)}
        pulses["chan3_raw"] = round(1500 - 400 * heave)
        target = {"target_system": 1, "target_component": 1, "chan7_raw": 0, "chan8_raw": 0}
        self._send(MavlinkPacket("RC_CHANNELS_OVERRIDE", {**target, **pulses}))
        now = time.monotonic()
        if now > self._alive + 1.0:
            self._alive = now
            self._send(heartbeat())
        self._due = max(now, self._due + STICK_S)
        while time.monotonic() < self._due:
            self._hear()

    def _send(self, packet: MavlinkPacket) -> None:
        if self._board is not None:
            self._link.sendto(self._codec.encode(packet), self._board)

    def _hear(self) -> None:
        try:
            data, self._board = self._link.recvfrom(4096)
        except TimeoutError:
            return
        for packet in self._reader.read([data]):
            if packet.name == "HEARTBEAT":
                right_mode = packet.fields["custom_mode"] == ALT_HOLD
                self._armed = right_mode and bool(
                    packet.fields["base_mode"] & MavModeFlag.SAFETY_ARMED
                )


def _judged(name: str, truth: TrueDepth, sticks: Sequence[tuple[float, float]]) -> Flight:
    """All releases but the first."""
    released = [
        (after[0], before[1])
        for before, after in pairwise(sticks)
        if before[1] != 0.0 and after[1] == 0.0
    ]
    return Flight(name, truth, [judge(truth, at, heave) for at, heave in released[1:]])
