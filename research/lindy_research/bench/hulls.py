"""A hull that is not the one of the vehicle file: what each kind of model error does to the feel.

The controller knows the vehicle file, the simulator has the hull. A line of the table is one kind
of difference; its stops are those of dives with random sticks, all sticks alike, of which surge and
sway may be let go at the same moment or kept.
"""

import sys
from collections.abc import Sequence
from functools import partial

import numpy as np

from lindy_research.bench.hull_runs import GOALS, HULLS, HullDive, HullGoals, fly
from lindy_research.bench.table import Figure
from tools.sweep.all_cores import on_all_cores

FIRST = 9000  # of the seeds that judge; none of them has tuned anything
SEEDS, QUICK_SEEDS = 20, 2


def figures(*, quick: bool = False) -> list[Figure]:
    """Of the Pioneer.

    Args:
        quick: 2 seeds instead of 20.
    """
    return table("pioneer", QUICK_SEEDS if quick else SEEDS)


def table(vehicle: str, seeds: int, section: str = "hulls") -> list[Figure]:
    """All lines, each hull of a line with as many dives as there are seeds."""
    jobs = [(line, seed) for seed in range(FIRST, FIRST + seeds) for line in HULLS]
    dives: dict[str, list[HullDive]] = {line: [] for line in HULLS}
    done = 0
    for result in on_all_cores(partial(_line, vehicle), jobs):
        if result is not None:
            index, flown = result
            dives[jobs[index][0]] += flown
            done += 1
            _say(f"hulls, {vehicle}: {done} of {len(jobs)}")
    return [figure for line in HULLS for figure in judged(vehicle, line, dives[line], section)]


def _line(vehicle: str, job: tuple[str, int]) -> list[HullDive]:
    line, seed = job
    return [fly(vehicle, difference, seed) for difference in HULLS[line]]


def judged(
    vehicle: str, line: str, dives: Sequence[HullDive], section: str = "hulls"
) -> list[Figure]:
    """One line of the table."""
    goals: HullGoals = GOALS[vehicle]
    bounces = [size for dive in dives for size in dive.bounces]
    overshoots = [size for dive in dives for size in dive.overshoots]
    last = line == list(HULLS)[-1]
    sagging = line == "thrust −40 %"
    rows = (
        ("bounce back", "mm", bounces, goals.last_bounce if last else goals.bounce),
        ("yaw overshoot", "deg", overshoots, goals.overshoot),
        ("depth error", "mm", [dive.depth_error for dive in dives], None),
        ("heading error", "deg", [d.heading_error for d in dives], goals.heading * sagging or None),
    )
    return [
        Figure(
            section=section, name=f"{vehicle}, {line}: {what}, worst", unit=unit,
            ours=max(sizes), baseline_name="" if goal is None else "limit", baseline=goal,
            goal=None if goal is None else 1.0, note=_spread(sizes),
        )
        for what, unit, sizes, goal in rows
    ]  # fmt: skip


def _spread(sizes: Sequence[float]) -> str:
    p50, p95 = np.percentile(sizes, [50, 95])
    return f"p50 {p50:.3g}, p95 {p95:.3g} of {len(sizes)}"


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
