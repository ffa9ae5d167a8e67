"""What a ground station costs, and how late its sticks are: a dive that a pymavlink pilot flies.

Latency is from the sending of MANUAL_CONTROL over UDP to the arrival of the `pilot/command` it
causes at a program on the topside's hub. Beside it: pymavlink alone, a process that answers each
MANUAL_CONTROL over UDP at once, there and back.
"""

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import msgspec

from lindy.api import LindyError
from lindy.api.messages import PilotCommand, topics
from lindy_research.bench.costs import Cost, costs
from lindy_research.bench.real_dive import RealDive, started
from lindy_research.bench.table import Figure
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import connected

Connection = Callable[..., Any]  # pymavlink's
CORES = 0.05  # goal, at the default streams with one ground station
PATIENCE_S = 60.0  # [s]
PERIOD_S = 0.04  # [s] of a ground station's sticks
WATCH_S = 12.0  # [s]
SENT = 300  # packets whose latency is measured
LOST_S = 1.0  # [s] after which one is not waited for
ECHO = """
import sys
from pymavlink import mavutil
link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{sys.argv[1]}", source_system=1)
link.mav.heartbeat_send(12, 3, 0, 0, 0)
while True:
    said = link.recv_match(type="MANUAL_CONTROL", blocking=True)
    link.mav.manual_control_send(255, said.x, 0, 500, 0, 0)
"""


def figures() -> list[Figure]:
    try:
        from pymavlink import mavutil  # pyright: ignore[reportMissingTypeStubs]
    except ImportError:
        return [Figure(section="mavlink", name="ground station", unit="", note="no pymavlink")]
    connection = cast(Connection, mavutil.mavlink_connection)
    with TemporaryDirectory(prefix="lindy-bench-") as folder:
        cost, ours = _flown(Path(folder), connection)
    alone = _alone(connection)
    return [
        Figure(
            section="mavlink", name="processor, default streams", unit="cores",
            ours=cost.cpu / 100.0, baseline_name="goal", baseline=CORES, goal=1.0,
        ),
        Figure(section="mavlink", name="memory", unit="MB", ours=cost.rss_mb),
        *(
            Figure(
                section="mavlink", name=f"MANUAL_CONTROL to pilot/command, {name}", unit="ms",
                ours=_share(ours, share), baseline_name="pymavlink echo",
                baseline=_share(alone, share), note=f"{len(ours)} of {SENT} arrived",
            )
            for name, share in (("p50", 0.5), ("p99", 0.99))
        ),
    ]  # fmt: skip


def _share(values: list[float], share: float) -> float:
    """[ms]"""
    return sorted(values)[min(len(values) - 1, int(share * len(values)))] * 1e3


def _flown(folder: Path, connection: Connection) -> tuple[Cost, list[float]]:
    port = _free_port()
    links = f'mavlink.links=["udpout:127.0.0.1:{port}"]'
    words = ("dive", "--stack", "mavlink", "--headless", "--set", links)
    with started(folder / "dive", *words) as dive:
        ground = connection(f"udpin:127.0.0.1:{port}", source_system=255, source_component=190)
        _arm(ground)
        with _steering(ground):
            cost = costs({"mavlink": dive.pids()["mavlink"]}, WATCH_S)["mavlink"]
        latencies = _latencies(dive, ground)
        ground.close()
    return cost, latencies


def _arm(ground: Any) -> None:
    ground.wait_heartbeat(timeout=PATIENCE_S)
    deadline = time.monotonic() + PATIENCE_S
    asked = 0.0
    while not ground.motors_armed():
        now = time.monotonic()
        if now > deadline:
            raise LindyError("the benchmark's drone does not arm for a ground station")
        _steer(ground, 0)
        if now > asked + 2.0:
            asked = now
            ground.mav.command_long_send(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
        time.sleep(PERIOD_S)


def _steer(ground: Any, x: int) -> None:
    ground.mav.manual_control_send(1, x, 0, 500, 0, 0)
    while ground.recv_match(blocking=False) is not None:
        pass


@contextmanager
def _steering(ground: Any) -> Generator[None]:
    """Centred sticks, and all telemetry read, for as long as this lasts."""
    stop = threading.Event()

    def steer() -> None:
        while not stop.wait(PERIOD_S):
            _steer(ground, 0)

    thread = threading.Thread(target=steer)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def _latencies(dive: RealDive, ground: Any) -> list[float]:
    """[s] Each packet has a stick position of its own, by which its command is known."""
    running = dive.running()
    decode = msgspec.msgpack.Decoder(PilotCommand).decode
    heard: dict[float, float] = {}  # surge → when first
    arrived = threading.Event()

    def hear(sample: Any) -> None:
        heard.setdefault(decode(sample.payload.to_bytes()).surge, time.monotonic())
        arrived.set()

    with connected(running.endpoints["topside"], namespace(running.vehicle)) as session:
        _ear = session.declare_subscriber(topics.PILOT_COMMAND.key, hear)
        known, found = set[float](), list[float]()
        for k in range(SENT):
            known |= set(heard)
            x = (100 + k) * (-1) ** k  # to and fro
            sent = time.monotonic()
            _steer(ground, x)
            while time.monotonic() < sent + LOST_S:
                arrived.wait(0.01)
                arrived.clear()
                if new := [at for surge, at in list(heard.items()) if surge not in known]:
                    found.append(min(new) - sent)
                    break
            time.sleep(PERIOD_S)
    return found


def _alone(connection: Connection) -> list[float]:
    """[s] There and back through a process that has pymavlink and nothing else."""
    port = _free_port()
    ground = connection(f"udpin:127.0.0.1:{port}", source_system=255, source_component=190)
    echo = subprocess.Popen([sys.executable, "-c", ECHO, str(port)])
    try:
        ground.wait_heartbeat(timeout=PATIENCE_S)
        found: list[float] = []
        for x in range(SENT):
            sent = time.monotonic()
            ground.mav.manual_control_send(1, x, 0, 500, 0, 0)
            if ground.recv_match(type="MANUAL_CONTROL", blocking=True, timeout=LOST_S) is not None:
                found.append(time.monotonic() - sent)
            time.sleep(PERIOD_S / 4)
        return found
    finally:
        echo.terminate()
        echo.wait()
        ground.close()


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]
