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
from lindy_research.ardusub_comparison.plain_station import PlainStation
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
from services.runtime.config.settings import deploy_file
from tools.recordings.recording import open_recording

THRUSTER = "[[vehicle.thruster]]"
# The drone of the firmware's simulator: 10.5 kg, no added mass, 1 N of buoyancy, quadratic drag,
# and all forces act at its centre. Its motors are quadratic and have no lag; from a command to them
# 14 ms pass. Those of the plane push as strongly along each of the two axes, and turn it by 0.25 m
# of that; so do the vertical ones. Its depth sensor is not averaged. The rest is that of
# bluerov2_heavy, with gains by the rule of that file: kp = M ω² less what rights it, kd = 2 ζ ω M,
# ki = kp / 5 s, ω = 5 rad/s in heave, roll and pitch, 8 in yaw.
PLANE = {
    'curve = "t200"': 'curve = "ardusub_simulator_plane"',
    "max_thrust = 30.4": "max_thrust = 72.8",
    "dead_band = 0.87": "dead_band = 0.285",
    "0.156": "0.125",
    "0.111": "0.125",
    "0.085": "0.0",
}
UPRIGHT = {
    'curve = "t200"': 'curve = "ardusub_simulator"',
    "max_thrust = 30.4": "max_thrust = 51.48",
    "dead_band = 0.87": "dead_band = 0.202",
    "0.12": "0.25",
    "0.218": "0.25",
}
MOTORS = {"time_constant = 0.029": "time_constant = 0.014", "lag = {": "# lag = {"}
BOTH = ("estimation.calibration.still_time=3", "ardusub.pressure_age=0.0")
LINDY = (
    "vehicle.mass=10.5",
    "vehicle.net_buoyancy=1.0",
    "vehicle.added_mass=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
    "vehicle.linear_damping=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
    "vehicle.quadratic_damping=[48.3, 62.1, 69.0, 7.08, 7.08, 7.08]",
    "vehicle.inertia=[0.268, 0.268, 0.268]",
    "vehicle.metacentric_height=0.0582",
    "control.depth.kp=262.0",
    "control.depth.kd=100.0",
    "control.depth.ki=52.0",
    "control.heading.kp=17.2",
    "control.heading.kd=4.1",
    "control.heading.ki=3.4",
    "control.heading.static={ kp = 17.2, kd = 4.1, zone = 0.001, leave = 0.15, blend = 0.5 }",
    "control.roll={ kp = 0.7, kd = 2.5 }",
    "control.pitch={ kp = 0.7, kd = 2.5 }",
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
    return _fly("Lindy", str(vehicle_file(folder)), LINDY, path, moves, folder)


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
    rows = [f"{m.at:.3f},{m.surge:.3f},0,{m.heave:.3f},{m.yaw:.3f}" for m in moves]
    truth_port = free_port()
    observer = TruthObserver(truth_port)
    text = "\n".join(["t,surge,sway,heave,yaw", *rows]) + "\n"
    dive(path, vehicle, overrides, text, folder, truth_port)
    return _judged(name, observer.close(), commanded(folder / "dive"))


def dive(
    path: str,
    vehicle: str,
    overrides: Sequence[str],
    script: str,
    folder: Path,
    truth_port: int,
    *,
    stack: str = "ardusub",
    parameters: str = "",
) -> None:
    """Lindy flies a stick log; its recording is `folder` / dive.

    Raises:
        RuntimeError: the dive does not end in order.
    """
    port, log = free_port(), folder / "sticks.csv"
    log.write_text(script)
    said = [sys.executable, "-P", "-m", "tools", "dive", "--stack", stack, "--headless"]
    said += ["--vehicle", vehicle, "--pilot", f"script:{log}", "--out", str(folder / "dive")]
    for assignment in (f"ardusub.url=udpin:127.0.0.1:{port}", *overrides):
        said += ["--set", assignment]
    with firmware(path, port, truth_port, folder / "board", parameters):
        done = subprocess.run(said, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"Lindy's dive failed:\n{done.stdout}{done.stderr}")


def vehicle_file(folder: Path) -> Path:
    """bluerov2_heavy with the motors of the firmware's simulator."""
    head, *thrusters = deploy_file("vehicles", "bluerov2_heavy").read_text().split(THRUSTER)
    parts = [head]
    for number, text in enumerate(thrusters):
        for ours, theirs in (MOTORS | (PLANE if number < 4 else UPRIGHT)).items():
            text = text.replace(ours, theirs, 1)
        parts.append(text)
    path = folder / "ardusub_simulator.toml"
    path.write_text(THRUSTER.join(parts))
    return path


def commanded(out: Path) -> list[StickMove]:
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
        station = PlainStation(link)
        station.wait_until_armed()
        began = time.monotonic()
        while (t := time.monotonic() - began) < moves[-1].at:
            sticks = sticks_at(list(moves), t)
            sent.append(sticks._replace(at=time.time()))
            station.steer(sticks)
    return _judged("ALT_HOLD", observer.close(), sent)


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
