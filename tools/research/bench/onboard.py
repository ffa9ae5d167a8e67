"""What the drone's side costs its computer: `lindy up drone --grouped`, without a recorder.

The pilot is a topside beside it on this computer, which is not counted. Every process of the
drone's side counts: its hub, its services (with a simulated vehicle) and its supervisor.
"""

import re
import socket
from pathlib import Path
from tempfile import TemporaryDirectory

from services.runtime.config.settings import deploy_file
from tools.research.bench.processes import Load, rss_mb
from tools.research.bench.real_dives import PILOT, real_dive, watched
from tools.research.bench.table import Figure

CORES, RSS_MB = 0.15, 90.0  # goals
LEFT_OUT = ("recorder", "visualizer")
_PARTS = {"supervisor": "supervisor", "hub_drone": "hub"}


def figures() -> list[Figure]:
    with TemporaryDirectory(prefix="lindy-bench-") as folder:
        load, memory = _fly(Path(folder))
    split = f"user {load.user:.2f}, system {load.system:.2f}"
    return [
        _figure("processor", "cores", load.cores, CORES, split),
        _figure("memory", "MB", load.rss_mb, RSS_MB, memory),
        _figure("thread switches", "1/s", load.switches_hz),
    ]


def _figure(name: str, unit: str, ours: float, goal: float | None = None, note: str = "") -> Figure:
    return Figure(
        section="onboard", name=f"grouped, no recorder, {name}", unit=unit, ours=ours,
        baseline_name="" if goal is None else "goal", baseline=goal,
        goal=None if goal is None else 1.0, note=note,
    )  # fmt: skip


def _fly(folder: Path) -> tuple[Load, str]:
    """The load, and in words how its memory is divided."""
    stack, endpoint = ("--stack", str(_stack(folder / "stack.toml"))), _free_endpoint()
    below = "up", "drone", "--grouped", "--listen", endpoint, *stack
    above = "up", "topside", "--grouped", "--connect", endpoint, *stack, *PILOT
    with real_dive(folder / "drone", *below) as drone:
        drone.until_said("calibrating")
        with real_dive(folder / "topside", *above) as topside:
            load, processes = watched([drone], [topside]), drone.processes()
            parts = [
                f"{_PARTS.get(name, 'services')} {rss_mb(p):.0f}" for p, name in processes.items()
            ]
            return load, f"{', '.join(parts)}; not shared: {load.private_mb:.0f}"


def _stack(path: Path) -> Path:
    """The simulated stack without what writes files."""
    tables = re.split(r"(?m)^(?=\[)", deploy_file("stacks", "simulated").read_text())
    left = tuple(f"[services.{name}]" for name in LEFT_OUT)
    path.write_text("".join(table for table in tables if not table.startswith(left)))
    return path


def _free_endpoint() -> str:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"
