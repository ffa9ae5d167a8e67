"""What the drone's side costs its computer: `lindy up drone --grouped`, without a recorder.

The pilot is a topside beside it on this computer, which is not counted. Every process of the
drone's side counts: its hub, its services (with a simulated vehicle) and its supervisor.
"""

import re
import socket
from pathlib import Path
from tempfile import TemporaryDirectory

from lindy_research.bench.costs import Cost, memory_mb, total
from lindy_research.bench.real_dive import PILOT, started, watched
from lindy_research.bench.table import Figure
from services.runtime.config.settings import deploy_file

CORES, MEMORY_MB = 0.15, 90.0  # goals
LEFT_OUT = ("recorder", "visualizer")
PARTS = {"0/supervisor": "supervisor", "0/hub_drone": "hub"}


def figures() -> list[Figure]:
    with TemporaryDirectory(prefix="lindy-bench-") as folder:
        costs, memory = _fly(Path(folder))
    whole = total(costs)
    return [
        _figure(
            "processor", "cores", whole.cpu / 100.0, CORES,
            _parts({name: f"{cost.cpu / 100.0:.3f}" for name, cost in costs.items()}),
        ),
        _figure(
            "memory", "MB", memory, MEMORY_MB,
            "resident, what they share counted in each: "
            + _parts({name: f"{cost.rss_mb:.0f}" for name, cost in costs.items()}),
        ),
        _figure("thread switches", "1/s", whole.switches),
    ]  # fmt: skip


def _parts(values: dict[str, str]) -> str:
    """`supervisor 0.02, hub 0.03, services 0.10`"""
    return ", ".join(f"{PARTS.get(name, 'services')} {value}" for name, value in values.items())


def _figure(name: str, unit: str, ours: float, goal: float | None = None, note: str = "") -> Figure:
    return Figure(
        section="onboard", name=f"grouped, no recorder, {name}", unit=unit, ours=ours,
        baseline_name="" if goal is None else "goal", baseline=goal,
        goal=None if goal is None else 1.0, note=note,
    )  # fmt: skip


def _fly(folder: Path) -> tuple[dict[str, Cost], float]:
    """What each process costs, and all of them together in memory [MB]."""
    stack, endpoint = ("--stack", str(without_files(folder / "stack.toml"))), _free_endpoint()
    below = "up", "drone", "--grouped", "--listen", endpoint, *stack
    above = "up", "topside", "--grouped", "--connect", endpoint, *stack, *PILOT
    with started(folder / "drone", *below) as drone:
        drone.until_said("calibrating")
        with started(folder / "topside", *above) as topside:
            costs = watched([drone], [topside])
            return costs, memory_mb(drone.pids().values())


def without_files(path: Path) -> Path:
    """The simulated stack without what writes files."""
    tables = re.split(r"(?m)^(?=\[)", deploy_file("stacks", "simulated").read_text())
    left = tuple(f"[services.{name}]" for name in LEFT_OUT)
    path.write_text("".join(table for table in tables if not table.startswith(left)))
    return path


def _free_endpoint() -> str:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"
