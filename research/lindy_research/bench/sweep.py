"""A thousand simulated dives: how long they take as a sweep, and as calls of `lindy simulate`."""

import subprocess
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from lindy_research.bench.real_dive import LINDY
from lindy_research.bench.table import Figure
from tools.sweep.all_cores import in_order
from tools.sweep.axes import axes
from tools.sweep.sweep import Job, fly_one

DIVES, CALLS, WORKERS = 20, 4, 2  # dives of the sweep; of the calls, which are slower
SECONDS = 60.0  # of each dive
GOAL = 20.0  # [min] for a thousand dives


def figures() -> list[Figure]:
    ours, calls = _minutes(_sweep(), DIVES), _minutes(_calls(), CALLS)
    name = f"1000 dives of {SECONDS:g} s on {WORKERS} cores"
    note = f"extrapolated from {DIVES} dives, the start of the workers included"
    return [
        Figure(
            section="sweep", name=name, unit="min", ours=ours, baseline_name="limit",
            baseline=GOAL, goal=1.0, note=note,
        ),
        Figure(
            section="sweep", name=f"{name}, beside calls", unit="min", ours=ours,
            baseline_name="lindy simulate, with files", baseline=calls,
            note=f"extrapolated from {CALLS} calls, {WORKERS} at a time",
        ),
    ]  # fmt: skip


def _minutes(seconds: float, dives: int) -> float:
    """[min] For a thousand dives."""
    return seconds * 1000.0 / dives / 60.0


def _sweep() -> float:
    """[s]"""
    plan = axes(["pioneer"], ["tether"], ["script:first_dive"], [], [f"1..{DIVES}"])
    jobs = [Job(dive, "simulated", SECONDS) for dive in plan.dives()]
    began = time.perf_counter()
    rows = in_order(fly_one, jobs, WORKERS)
    seconds = time.perf_counter() - began
    for row in rows:
        if row is None or row["end"] != "clean":
            raise RuntimeError(f"a dive of the sweep failed: {row}")
    return seconds


def _calls() -> float:
    """[s]"""
    began = time.perf_counter()
    with TemporaryDirectory(prefix="lindy-") as folder:
        for first in range(1, CALLS + 1, WORKERS):
            calls = [_call(Path(folder), seed) for seed in range(first, first + WORKERS)]
            for call in calls:
                if call.wait() != 0:
                    raise RuntimeError("a call of lindy simulate failed")
    return time.perf_counter() - began


def _call(folder: Path, seed: int) -> "subprocess.Popen[bytes]":
    command = [*LINDY, "simulate", "--seed", str(seed)]
    command += ["--seconds", str(SECONDS), "--out", str(folder / str(seed))]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)
