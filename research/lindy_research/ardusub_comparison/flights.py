"""The two flights: Lindy through services/ardusub, and ArduSub's ALT_HOLD by override."""

import socket
import subprocess
import sys
import time
from collections.abc import Generator, Sequence
from itertools import pairwise
from math import copysign
from pathlib import Path
from typing import NamedTuple

from lindy_research.ardusub_comparison.firmware import TruthObserver, firmware, free_port
from lindy_research.ardusub_comparison.releases import (
    JudgedRelease,
    TrueMotion,
    judge,
    judge_turn,
    swayed,
)
from lindy_research.ardusub_comparison.sticks import StickMove, sticks_at
from messages import topics
from messages.pilot import PilotCommand
from services.mavlink_io.io.codec import FrameReader, MavlinkCodec
from services.mavlink_io.numbers import MavCommand, MavModeFlag
from services.mavlink_io.packet import MavlinkPacket, command, heartbeat
from services.runtime.config.settings import deploy_file
from tools.recordings.recording import open_recording

ALT_HOLD = 2
# [-] of its full sticks, for the speeds that Lindy flies at its own: 1 m/s and 1.05 rad/s.
ALT_HOLD_SURGE, ALT_HOLD_YAW = 0.49, 0.4
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
BOTH = ("estimation.calibration.still_time=3", "ardusub.pressure_age=0.0")
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
    *BOTH,
)


class Flight(NamedTuple):
    """What was found in one flight."""

    name: str
    truth: TrueMotion
    releases: list[JudgedRelease]  # of heave
    swayed: list[float]  # [m] of depth, where surge was let go and heave had not been pushed
    turns: list[JudgedRelease]


def fly_lindy(path: str, moves: Sequence[StickMove], folder: Path) -> Flight:
    """With a vehicle file of the simulator's drone.

    Raises:
        RuntimeError: the dive does not end in order.
    """
    folder.mkdir(parents=True)
    return _fly("Lindy", str(_vehicle_file(folder)), LINDY, path, moves, folder)


def fly_shipped(path: str, moves: Sequence[StickMove], folder: Path) -> Flight:
    """With the vehicle file as it comes, whose mass, drag and thrust are another vehicle's.

    Raises:
        RuntimeError: the dive does not end in order.
    """
    folder.mkdir(parents=True)
    return _fly("Lindy", "bluerov2_heavy", BOTH, path, moves, folder)


def _fly(
    name: str,
    vehicle: str,
    overrides: Sequence[str],
    path: str,
    moves: Sequence[StickMove],
    folder: Path,
) -> Flight:
    port, truth_port, out = free_port(), free_port(), folder / "dive"
    script = folder / "sticks.csv"
    rows = [f"{m.at:.3f},{m.surge:.3f},0,{m.heave:.3f},{m.yaw:.3f}" for m in moves]
    script.write_text("\n".join(["t,surge,sway,heave,yaw", *rows]) + "\n")
    said = [sys.executable, "-P", "-m", "tools", "dive", "--stack", "ardusub", "--headless"]
    said += ["--vehicle", vehicle, "--pilot", f"script:{script}", "--out", str(out)]
    for assignment in (f"ardusub.url=udpin:127.0.0.1:{port}", *overrides):
        said += ["--set", assignment]
    observer = TruthObserver(truth_port)
    with firmware(path, port, truth_port, folder / "board"):
        done = subprocess.run(said, capture_output=True, text=True, check=False)
    truth = observer.close()
    if done.returncode != 0:
        raise RuntimeError(f"Lindy's dive failed:\n{done.stdout}{done.stderr}")
    return _judged(name, truth, _commanded(out))


def _vehicle_file(folder: Path) -> Path:
    """bluerov2_heavy with the motors of the firmware's simulator."""
    text = deploy_file("vehicles", "bluerov2_heavy").read_text()
    for ours, theirs in MOTORS.items():
        text = text.replace(ours, theirs)
    path = folder / "ardusub_simulator.toml"
    path.write_text(text)
    return path


def _commanded(out: Path) -> list[StickMove]:
    """As the drone heard them; times are UTC."""
    found = list[StickMove]()
    recording = open_recording(out)
    for raw in recording.raw():
        if raw.key == topics.PILOT_COMMAND.key:
            message = recording.decode(raw)
            if isinstance(message, PilotCommand):
                m = message
                found.append(StickMove(raw.log_ns / 1e9, m.heave, m.surge, m.yaw))
    return found


def fly_alt_hold(path: str, moves: Sequence[StickMove], folder: Path) -> Flight:
    """
    Raises:
        RuntimeError: the board does not arm.
    """
    port, truth_port = free_port(), free_port()
    observer, sent = TruthObserver(truth_port), list[StickMove]()
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
            sticks = sticks_at(list(moves), t)
            sent.append(sticks._replace(at=time.time()))
            station.steer(sticks)
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
            self.steer(StickMove(0.0))
            now = time.monotonic()
            if now - began > PATIENCE_S:
                raise RuntimeError("the board does not arm")
            if now - began > SETTLE_S and now - asked > 1.0:
                asked = now
                self._send(command(1, MavCommand.DO_SET_MODE, 1, ALT_HOLD))
                self._send(command(1, MavCommand.COMPONENT_ARM_DISARM, 1))

    def steer(self, sticks: StickMove) -> None:
        """Sticks now, then hear the board until the next are due."""
        pulses = {f"chan{n}_raw": 1500 for n in range(1, 7)}
        pulses["chan3_raw"] = round(1500 - 400 * sticks.heave)
        pulses["chan4_raw"] = round(1500 + 400 * ALT_HOLD_YAW * sticks.yaw)
        pulses["chan5_raw"] = round(1500 + 400 * ALT_HOLD_SURGE * sticks.surge)
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


def _judged(name: str, truth: TrueMotion, sticks: Sequence[StickMove]) -> Flight:
    """All releases but the first."""
    flight = Flight(name, truth, [], [], [])
    for before, after in list(_releases(sticks))[1:]:
        at = after.at
        if before.heave and not after.heave:
            flight.releases.append(judge(truth, at, copysign(1.0, before.heave)))
        elif before.surge and not after.surge:
            flight.swayed.append(swayed(truth, at))
        if before.yaw and not after.yaw:
            flight.turns.append(judge_turn(truth, at, copysign(1.0, before.yaw)))
    return flight


def _releases(sticks: Sequence[StickMove]) -> Generator[tuple[StickMove, StickMove]]:
    for before, after in pairwise(sticks):
        if any(b and not a for b, a in zip(before[1:], after[1:], strict=True)):
            yield before, after
