"""What a board with ArduSub adds: latency, the wrench it gives, rates, and the end of silence.

On the double of tests/support/ardusub_double, packet by packet on virtual time: nothing here
depends on the machine, but for the cost of the mixer, and of the service in a real dive with the
double as a process.
"""

import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from lindy_research.bench.table import Figure
from messages import topics
from messages.sensors import ImuSample, PressureSample
from services.ardusub.mixing import FRAMES, MixedSticks, Mixer, RcChannel
from services.control.allocation.allocation import Allocation
from services.marine.vehicle import total_wrench, wrench_per_newton
from tests.support.ardusub_double.cable import DOWN, MS, VEHICLE, Cable, S
from tests.support.started_dives import PILOT, started, watched

SECTION = "ardusub"
SCALE = np.array([30.0, 30.0, 40.0, 3.0, 3.0, 6.0])  # [N, N m] a wrench that the vehicle can give
SHARES = (0.1, 0.3, 0.6, 1.0)  # of it
WRENCHES = 300  # per share
STEPS = 60  # of the stick
COMMAND_NS = 9 * MS  # [ns] between two commands: at every phase of the board's clock
PROCESSOR = 5.0  # [%] of a core, goal


def figures() -> list[Figure]:
    return [*_wrenches(), *_latencies(), *_rates(), *_silence(), _cost(), _service()]


def _figure(name: str, unit: str, ours: float, **more: object) -> Figure:
    return Figure(section=SECTION, name=name, unit=unit, ours=ours, **more)  # type: ignore[arg-type]


def _wrenches() -> list[Figure]:
    """Relative error of the wrench, axes scaled to what the vehicle can give."""
    found: list[Figure] = []
    for share in SHARES:
        ours, plain = _errors(share, curved=True), _errors(share, curved=False)
        for name, part in (("median", 0.5), ("95 %", 0.95)):
            found.append(
                _figure(
                    f"wrench error {name}, {share:.0%} of the range", "%",
                    100.0 * float(np.quantile(ours, part)),
                    baseline_name="without the thrust curve",
                    baseline=100.0 * float(np.quantile(plain, part)),
                    goal=1.0,
                )
            )  # fmt: skip
    return found


def _errors(share: float, *, curved: bool) -> NDArray[np.float64]:
    mixer, allocation = _mixer(), Allocation(VEHICLE)
    columns = [wrench_per_newton(t) for t in VEHICLE.thruster]
    draw = np.random.default_rng(1)
    errors = np.zeros(WRENCHES)
    for index in range(WRENCHES):
        x, y, z, k, m, n = (draw.uniform(-1.0, 1.0, 6) * SCALE * share).tolist()
        thrust = allocation.allocate((x, y, z, k, m, n)).thrust
        asked = np.array(total_wrench(columns, thrust)) / SCALE
        given = np.array(mixer.mix(thrust, curved=curved).wrench) / SCALE
        errors[index] = np.linalg.norm(given - asked) / np.linalg.norm(asked)
    return errors


def _mixer() -> Mixer:
    return Mixer(FRAMES[2], VEHICLE.thruster, [RcChannel()] * 6)


def _latencies() -> list[Figure]:
    """From a thruster command to the motors; the board takes its inputs every 20 ms."""
    found: list[Figure] = []
    for version in ("4.5", "4.8"):
        delays = _stick_delays(version)
        for name, part in (("median", 0.5), ("95 %", 0.95)):
            found.append(
                _figure(
                    f"command to motors {version}, {name}", "ms",
                    float(np.quantile(delays, part)),
                    baseline_name="the board's own input period", baseline=20.0, goal=1.2,
                )
            )  # fmt: skip
    return found


def _stick_delays(version: str) -> list[float]:
    """[ms]"""
    cable = Cable(version).accepted()
    cable.thrust, cable.period_ns = DOWN, COMMAND_NS
    cable.run(1.5)
    delays, draw = list[float](), np.random.default_rng(3)
    for number in range(STEPS):
        cable.run(float(draw.uniform(0.03, 0.06)))
        newtons = 6.0 + 2.0 * (number % 2)
        before = list(cable.board.servo)
        asked = (cable.now // COMMAND_NS + 1) * COMMAND_NS  # when the command is sent
        cable.thrust = (*DOWN[:4], *(newtons,) * 4)
        while cable.board.servo == before:
            cable.run(0.001)
        delays.append((cable.now - asked) / MS)
    return delays


def _rates() -> list[Figure]:
    found: list[Figure] = []
    for version in ("4.5", "4.8"):
        cable = Cable(version).accepted()
        began, seconds = cable.now, 5.0
        cable.run(seconds)
        for kind, name, hz, asked in (
            (ImuSample, "IMU", topics.IMU.hz, "asked for"),
            (PressureSample, "pressure", 10.0, "the board takes one over"),
        ):
            got = [m for at, m in cable.samples if at > began and isinstance(m, kind)]
            found.append(
                _figure(
                    f"{name} {version}", "1/s", len(got) / seconds,
                    baseline_name=asked, baseline=hz,
                )
            )  # fmt: skip
    return found


def _silence() -> list[Figure]:
    """From the last command to neutral motors."""

    def until_neutral(stop: Callable[[Cable], None]) -> float:
        cable = Cable().accepted()
        cable.thrust = DOWN
        cable.run(1.5)
        stop(cable)
        began = cable.now
        while cable.board.servo != [1500] * 8:
            cable.run(0.001)
        return (cable.now - began) / S

    def nobody_commands(cable: Cable) -> None:
        cable.thrust = None

    def the_service_died(cable: Cable) -> None:
        cable.deaf, cable.thrust = True, None

    return [
        _figure(
            "silence of control to neutral", "s", until_neutral(nobody_commands),
            baseline_name="the board's failsafe alone", baseline=until_neutral(the_service_died),
            goal=0.1,
        )
    ]  # fmt: skip


def _cost() -> Figure:
    """Of the mixer, beside that of control's allocation."""
    mixer, allocation, draw = _mixer(), Allocation(VEHICLE), np.random.default_rng(2)
    wrenches = (draw.uniform(-1.0, 1.0, (WRENCHES, 6)) * SCALE).tolist()
    thrusts = [allocation.allocate((x, y, z, k, m, n)).thrust for x, y, z, k, m, n in wrenches]

    def mix(thrust: tuple[float, ...]) -> MixedSticks:
        return mixer.mix(thrust)

    ours = [_seconds(lambda at=thrust: mix(at)) for thrust in thrusts]
    theirs = [_seconds(lambda w=wrench: allocation.allocate(tuple(w))) for wrench in wrenches]
    return _figure(
        "mixing one command", "µs", 1e6 * median(ours),
        baseline_name="control's allocation", baseline=1e6 * median(theirs),
    )  # fmt: skip


def _seconds(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def _service() -> Figure:
    """Of a dive as a process each; in steady flight."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    board = "tests.support.ardusub_double.udp"
    said = [sys.executable, "-P", "-m", board, "--to", str(port), "--version", "4.8"]
    words = ("--stack", "ardusub", "--vehicle", "bluerov2_heavy", "--headless", *PILOT)
    where = ("--set", f"ardusub.url=udpin:127.0.0.1:{port}")
    double = subprocess.Popen(said, cwd=Path(__file__).parents[3], stdout=subprocess.DEVNULL)
    try:
        with (
            TemporaryDirectory(prefix="lindy-bench-") as folder,
            started(Path(folder) / "dive", "dive", *words, *where) as dive,
        ):
            cost = watched([dive], [dive])["0/ardusub"]
    finally:
        double.terminate()
        double.wait()
    return _figure(
        "processor of the service in a dive", "%", cost.cpu,
        baseline_name="goal", baseline=PROCESSOR, goal=1.0,
    )  # fmt: skip
