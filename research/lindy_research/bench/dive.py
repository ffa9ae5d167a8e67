"""What a whole real dive costs this computer: one process per service, beside `--grouped`.

Both shapes take turns, so whatever else the machine does hits both. Every process counts: hubs,
services and the supervisor.
"""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import NamedTuple

from lindy_research.bench.costs import Cost, total
from lindy_research.bench.real_dive import PILOT, started, watched
from lindy_research.bench.table import Figure
from tools.report.report import Report

ROUNDS = 2  # of each shape; the median counts
MANY = 4  # dives side by side
SHAPES = {"separate": (), "grouped": ("--grouped",)}


class Goals(NamedTuple):
    cores: float
    p50_ms: float  # [ms] sensor to thruster
    p99_ms: float  # [ms]
    switches_hz: float  # [1/s]
    rss_mb: float | None  # [MB]


GOALS = {
    "separate": Goals(0.65, 2.5, 8.0, 9000.0, None),
    "grouped": Goals(0.35, 0.8, 5.0, 4500.0, 350.0),
}


def figures() -> list[Figure]:
    with TemporaryDirectory(prefix="lindy-bench-") as folder:
        flown: dict[str, list[tuple[Cost, Report]]] = {shape: [] for shape in SHAPES}
        for turn in range(ROUNDS):
            for shape, options in SHAPES.items():
                flown[shape].append(_fly(Path(folder) / f"{shape}-{turn}", options))
        shown = [figure for shape in SHAPES for figure in _of_shape(shape, flown[shape])]
        both = [median(cost.cpu for cost, _ in flown[shape]) / 100.0 for shape in SHAPES]
        shown.append(
            Figure(
                section="dive", name="processor, grouped beside separate", unit="cores",
                ours=both[1], baseline_name="separate", baseline=both[0], goal=0.5,
            )
        )  # fmt: skip
        return [*shown, _many(Path(folder))]


def _fly(out: Path, options: tuple[str, ...]) -> tuple[Cost, Report]:
    with started(out, "dive", "--headless", *PILOT, *options) as dive:
        return total(watched([dive], [dive])), dive.report()


def _of_shape(shape: str, flown: list[tuple[Cost, Report]]) -> Iterator[Figure]:
    costs, goals = [cost for cost, _ in flown], GOALS[shape]
    delays = [report.latency_ms.sensor_to_thruster for _, report in flown]
    p50s = [delay.p50 for delay in delays if delay.p50 is not None]
    p99s = [delay.p99 for delay in delays if delay.p99 is not None]
    cores = [cost.cpu / 100.0 for cost in costs]
    system = f"of it system {median(cost.system / 100.0 for cost in costs):.2f}"
    yield _beside(shape, "processor", "cores", cores, goals.cores, system)
    yield _beside(shape, "sensor to thruster, p50", "ms", p50s, goals.p50_ms)
    yield _beside(shape, "sensor to thruster, p99", "ms", p99s, goals.p99_ms)
    switches, memory = [cost.switches for cost in costs], [cost.rss_mb for cost in costs]
    yield _beside(shape, "thread switches", "1/s", switches, goals.switches_hz)
    yield _beside(shape, "memory", "MB", memory, goals.rss_mb)


def _beside(
    shape: str, name: str, unit: str, measured: list[float], goal: float | None, note: str = ""
) -> Figure:
    return Figure(
        section="dive", name=f"{shape}, {name}", unit=unit, ours=median(measured),
        baseline_name="" if goal is None else "goal", baseline=goal,
        goal=None if goal is None else 1.0, note=note,
    )  # fmt: skip


def _many(folder: Path) -> Figure:
    """Several grouped dives at once."""
    with ExitStack() as exits:
        dives = [
            exits.enter_context(
                started(folder / f"many-{n}", "dive", "--headless", "--grouped", *PILOT)
            )
            for n in range(MANY)
        ]
        together = total(watched(dives, dives))
        p99s = [dive.report().latency_ms.sensor_to_thruster.p99 for dive in dives]
    worst = max(p99 for p99 in p99s if p99 is not None)
    return Figure(
        section="dive", name=f"{MANY} grouped dives side by side, processor", unit="cores",
        ours=together.cpu / 100.0, baseline_name="goal", baseline=1.0, goal=1.0,
        note=f"worst sensor to thruster p99 {worst:.1f} ms",
    )  # fmt: skip
