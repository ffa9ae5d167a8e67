"""What a minute of a simulated dive costs: with its files, without them and the chain alone, beside
goals in times real time; how large the files are; and what its report costs.

In processor time, so that other work on the machine counts little; the variants take turns and the
best of each counts.
"""

import tempfile
import time
from collections.abc import Collection
from contextlib import closing
from pathlib import Path

from lindy.api.dives import Registry, Stack, VirtualHost
from lindy.api.recordings import open_recording
from lindy_research.bench.table import Figure
from lindy_research.dives import CHAIN
from services.runtime.hosts.loop import rare_collections
from tools.report.report import Extras, make_report

SECONDS = 60  # [s] of each dive
TURNS = 2
FILES = ("recorder", "visualizer")
WITH_FILES, NO_FILES, CHAIN_ALONE = 18.0, 28.0, 35.0  # [-] goals, times real time
RRD_BEFORE = 15.5  # [MB] per 100 s, when each four seconds were written by themselves
REPORT = 0.5  # [s] goal, per minute of dive


def figures() -> list[Figure]:
    services = Registry.read()
    everything = [*services]
    variants = {
        "with its files": (everything, WITH_FILES),
        "without recorder and viewer": ([n for n in services if n not in FILES], NO_FILES),
        "the chain alone": (CHAIN, CHAIN_ALONE),
    }
    best = dict.fromkeys(variants, float("inf"))
    with tempfile.TemporaryDirectory() as name:
        for turn in range(TURNS):
            for variant, (names, _) in variants.items():
                folder = Path(name) / f"{turn} {variant}"
                best[variant] = min(best[variant], _cost(services, names, folder))
        recorded = Path(name) / "0 with its files"
        sizes = {end: (recorded / f"dive.{end}").stat().st_size / 1e6 for end in ("mcap", "rrd")}
        report = min(_report_cost(recorded) for _ in range(TURNS))
    return [
        *(_speed(variant, best[variant], goal) for variant, (_, goal) in variants.items()),
        _size("dive.mcap", sizes["mcap"]),
        _size("dive.rrd", sizes["rrd"], "before", RRD_BEFORE, 0.25),
        Figure(
            section="simulate", name="report of a minute", unit="s", ours=report,
            baseline_name="half a second", baseline=REPORT, goal=1.0,
        ),
    ]  # fmt: skip


def _cost(services: Registry, names: Collection[str], folder: Path) -> float:
    """[s] of processor time per second of a dive."""
    stack = Stack(pilot="script:first_dive", virtual=True, out=str(folder))
    host = VirtualHost()
    host.add_all(services.only({name: services[name] for name in names}), stack)
    began = time.process_time()
    with closing(host), rare_collections():
        host.run(SECONDS * 1_000_000_000)
    return (time.process_time() - began) / SECONDS


def _report_cost(folder: Path) -> float:
    """[s] of processor time per minute of a dive."""
    began = time.process_time()
    make_report(open_recording(folder), Extras())
    return (time.process_time() - began) * 60.0 / SECONDS


def _speed(variant: str, cost: float, goal: float) -> Figure:
    return Figure(
        section="simulate", name=f"a second, {variant}", unit="ms", ours=1e3 * cost,
        baseline_name=f"1/{goal:g} of real time", baseline=1e3 / goal, goal=1.0,
        note=f"{1.0 / cost:.3g} × real time",
    )  # fmt: skip


def _size(
    name: str,
    size: float,
    other: str = "",
    baseline: float | None = None,
    goal: float | None = None,
) -> Figure:
    """
    Args:
        size: [MB] of the whole dive.
    """
    return Figure(
        section="simulate", name=f"{name} per 100 s", unit="MB", ours=size * 100.0 / SECONDS,
        baseline_name=other, baseline=baseline, goal=goal,
    )  # fmt: skip
