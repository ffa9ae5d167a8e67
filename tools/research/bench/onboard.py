"""What the drone's side costs its computer: `lindy up drone --grouped`, without a recorder.

The pilot is a topside beside it on this computer, which is not counted. Every process of the
drone's side counts: its hub, its services (with a simulated vehicle) and its supervisor.
"""

import re
import socket
from pathlib import Path
from tempfile import TemporaryDirectory

from services.runtime.config.settings import deploy_file
from tools.research.bench.processes import Load
from tools.research.bench.real_dives import PILOT, real_dive, watched
from tools.research.bench.table import Figure

CORES, RSS_MB = 0.15, 90.0  # goals
LEFT_OUT = ("recorder", "visualizer")


def figures() -> list[Figure]:
    with TemporaryDirectory(prefix="lindy-bench-") as folder:
        load = _fly(Path(folder))
    split = f"user {load.user:.2f}, system {load.system:.2f}"
    return [
        _figure("processor", "cores", load.cores, CORES, split),
        _figure(
            "memory", "MB", load.rss_mb, RSS_MB,
            f"what is shared counted once: {load.pss_mb:.0f} MB",
        ),
        Figure(section="onboard", name="thread switches", unit="1/s", ours=load.switches_hz),
    ]  # fmt: skip


def _figure(name: str, unit: str, ours: float, goal: float, note: str) -> Figure:
    return Figure(
        section="onboard", name=f"grouped, no recorder, {name}", unit=unit, ours=ours,
        baseline_name="goal", baseline=goal, goal=1.0, note=note,
    )  # fmt: skip


def _fly(folder: Path) -> Load:
    stack, endpoint = ("--stack", str(_stack(folder / "stack.toml"))), _free_endpoint()
    below = "up", "drone", "--grouped", "--listen", endpoint, *stack
    above = "up", "topside", "--grouped", "--connect", endpoint, *stack, *PILOT
    with real_dive(folder / "drone", *below) as drone:
        drone.until_said("calibrating")
        with real_dive(folder / "topside", *above) as topside:
            return watched([drone], [topside])


def _stack(path: Path) -> Path:
    """The simulated stack without what writes files."""
    tables = re.split(r"(?m)^(?=\[)", deploy_file("stacks", "simulated").read_text())
    left = tuple(f"[services.{name}]" for name in LEFT_OUT)
    path.write_text("".join(table for table in tables if not table.startswith(left)))
    return path


def _free_endpoint() -> str:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"
