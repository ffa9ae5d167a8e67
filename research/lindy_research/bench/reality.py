"""The estimator where nothing is as its file says: simulated dives as rough as real ones, and real
dives on record where `LINDY_REAL` names their folder. Which seeds or logs miss a goal, and the
stops, are in the tables of reality_sim.py and reality_real.py.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from lindy_research.bench.reality_dives import INCONSISTENT, RoughDive
from lindy_research.bench.reality_logs import LoggedDive
from lindy_research.bench.reality_real import (
    FOLDER,
    GOALS,
    NO_FOLDER,
    NOT_WRONG,
    WRONG,
    Goal,
    read_all,
    values,
)
from lindy_research.bench.reality_sim import ROWS, flown
from lindy_research.bench.table import Figure

SEEDS, FEW = range(500, 524), range(500, 503)
# What no simulated dive should have.
NEVER: tuple[tuple[str, Callable[[RoughDive], bool]], ...] = (
    ("never armed", lambda d: not d.armed),
    ("IMU inconsistent", lambda d: INCONSISTENT in d.counts),
    ("failsafe not by the link", lambda d: bool(d.failsafes)),
)


def figures(*, quick: bool = False) -> list[Figure]:
    real = [*_real(os.environ.get(FOLDER))]  # first: a wrong folder is said at once
    return [*simulated(flown(FEW if quick else SEEDS)), *real]


def simulated(dives: Sequence[RoughDive]) -> Iterator[Figure]:
    """How many dives are wrong, and the medians of the errors in calm water and in waves."""
    for name, wrong in NEVER:
        yield _none(f"{len(dives)} simulated dives, {name}", sum(wrong(d) for d in dives))
    for water, calm in (("calm", True), ("waves", False)):
        errors = [d.errors for d in dives if d.errors and (d.circumstances.waves is None) is calm]
        for name, unit, of in ROWS if errors else ():
            median = float(np.median([of(e) for e in errors]))
            worst = max(of(e) for e in errors)
            note = f"median of {len(errors)} dives; worst {worst:.3g}"
            yield Figure(
                section="reality", name=f"simulated, {water}: {name}", unit=unit, ours=median,
                note=note,
            )  # fmt: skip


def _real(folder: str | None) -> Iterator[Figure]:
    if not folder:
        yield Figure(section="reality", name="real dives", unit="", note=NO_FOLDER)
        return
    dives, _ = read_all(Path(folder))
    for part in ("even", "odd"):
        these = [d for d in dives if d.part == part and not d.unusable]
        if these:
            yield from _part(f"{len(these)} real dives, {part} seconds", these)


def _part(words: str, dives: Sequence[LoggedDive]) -> Iterator[Figure]:
    for name, wrong in WRONG:
        if name not in NOT_WRONG:
            yield _none(f"{words}, {name}", sum(wrong(d) for d in dives))
    for goal in GOALS:
        if found := values(goal, dives):
            yield from _judged(f"{words}: {goal.name}", goal, found)


def _judged(name: str, goal: Goal, found: Sequence[float]) -> Iterator[Figure]:
    """The figure is held to its most; and its least, where it has one, to the figure."""
    median, note = float(np.median(found)), f"median; worst {max(found):.3g}"
    yield Figure(
        section="reality", name=name, unit=goal.unit, ours=median,
        baseline_name="" if goal.most is None else "goal", baseline=goal.most,
        goal=None if goal.most is None else 1.0, note=note,
    )  # fmt: skip
    if goal.least is not None:
        yield Figure(
            section="reality", name=f"{name}, its least", unit=goal.unit, ours=goal.least,
            baseline_name="median", baseline=median, goal=1.0,
        )  # fmt: skip


def _none(name: str, count: int) -> Figure:
    """A count that should be 0."""
    return Figure(
        section="reality", name=name, unit="dives", ours=float(count),
        baseline_name="less than", baseline=1.0, goal=0.5,
    )  # fmt: skip
