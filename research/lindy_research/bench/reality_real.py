"""The estimator over real dives on record, as a table: `make real LINDY_REAL=FOLDER`.

What a log must be to be known, and what the errors are measured against: reality_logs.py and
reality_smoother.py.
"""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from math import degrees
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lindy.api import LindyError
from lindy_research.bench.reality_logs import LoggedDive, Part, judged, known
from tools.sweep.all_cores import in_order

FOLDER = "LINDY_REAL"
NO_FOLDER = (
    f"{FOLDER} is not set: name the folder of real dives, bags of ExjobbROV, small.BIN, small.tlog"
)
PARTS: dict[Part, str] = {
    "even": "even seconds: settings may be chosen with them",
    "odd": "odd seconds: for judging",
    "others": "others",
}


class Goal(NamedTuple):
    """A figure of a dive, and what its median is held to."""

    name: str
    unit: str
    of: Callable[[LoggedDive], float | None]
    most: float | None = None  # of the median; None: shown only
    least: float | None = None


def _in(factor: float, name: str) -> Callable[[LoggedDive], float | None]:
    def value(dive: LoggedDive) -> float | None:
        found = getattr(dive, name)
        return None if found is None else factor * found

    return value


def _own(factor: float, name: str) -> Callable[[LoggedDive], float | None]:
    def value(dive: LoggedDive) -> float | None:
        found = getattr(dive.own, name)
        return None if found is None else factor * found

    return value


def _size_of_rho(dive: LoggedDive) -> float | None:
    return None if dive.rho is None else abs(dive.rho)


def _import(dive: LoggedDive) -> float:
    return 1e3 * dive.import_s / dive.seconds


DEGREE = degrees(1.0)
GOALS = (
    Goal("roll rms", "deg", _in(DEGREE, "roll"), most=0.5),
    Goal("roll of the own filter", "deg", _own(DEGREE, "roll")),
    Goal("pitch rms", "deg", _in(DEGREE, "pitch"), most=0.5),
    Goal("pitch of the own filter", "deg", _own(DEGREE, "pitch")),
    Goal("depth rms", "mm", _in(1e3, "depth"), most=8.0),
    Goal("depth of the own filter", "mm", _own(1e3, "depth")),
    Goal("depth rate rms", "mm/s", _in(1e3, "depth_rate"), most=20.0),
    Goal("NEES of depth", "", _in(1.0, "nees_depth"), most=1.5, least=0.5),
    Goal("NEES of depth rate", "", _in(1.0, "nees_rate"), most=1.5, least=0.5),
    Goal("NEES of tilt", "", _in(1.0, "nees_tilt"), most=1.5, least=0.5),
    Goal("|ρ| of the pressure", "", _size_of_rho, most=0.3),
    Goal("starts after", "s", _in(1.0, "start")),
    Goal("IMU thrown away", "%", _in(100.0, "thrown_away")),
    Goal("one IMU sample", "µs", _in(1e6, "cpu")),
    Goal("import", "ms per s of dive", _import),
)
# What no dive should have.
WRONG: tuple[tuple[str, Callable[[LoggedDive], bool]], ...] = (
    ("IMU inconsistent", lambda d: d.inconsistent),
    ("without attitude at any time", lambda d: d.start is None or d.attitude < 1.0),
    ("IMU noisy", lambda d: d.noisy),
)
NOT_WRONG = ("IMU noisy",)  # it is used, with less weight


def read_all(folder: Path) -> tuple[list[LoggedDive], list[str]]:
    """Every known log of a folder, and the names of its other files.

    Raises:
        LindyError: as `known`.
    """
    logs, unknown = known(folder)
    return in_order(judged, logs), unknown


def table(dives: Sequence[LoggedDive], unknown: Sequence[str]) -> Iterator[str]:
    """Which logs were judged, and the figures of each part."""
    unusable = [d for d in dives if d.unusable]
    yield f"{len(dives)} known logs, {len(dives) - len(unusable)} of which can be judged"
    whys: dict[str, list[str]] = {}
    for dive in unusable:
        whys.setdefault(dive.unusable.split(":")[-1].split(";")[0].strip(), []).append(dive.name)
    for why, names in whys.items():
        yield f"  {len(names)}: {why}: {', '.join(names)}"
    if unknown:
        yield f"not known, and left alone: {', '.join(unknown)}"
    for part, words in PARTS.items():
        these = [d for d in dives if d.part == part and not d.unusable]
        if these:
            yield from _part(words, these)


def _part(words: str, dives: Sequence[LoggedDive]) -> Iterator[str]:
    upright = [d for d in dives if not d.on_end]
    yield f"{len(dives)} dives of {words}; {len(upright)} without standing on end"
    for name, wrong in WRONG:
        names = [d.name for d in dives if wrong(d)]
        goal = "" if name in NOT_WRONG else "goal 0"
        yield f"  {name:30s} {len(names):9d} dives  {goal}  {', '.join(names)}".rstrip()
    yield f"  {'':30s} {'median':>9s} {'worst':>9s} {'upright':>9s} {'worst':>9s}"
    for goal in GOALS:
        cells = [cell for group in (dives, upright) for cell in _cells(goal, group)]
        judgement = f"{goal.unit}  {_goal(goal, dives)}".rstrip()
        yield f"  {goal.name:30s} {' '.join(f'{cell:>9s}' for cell in cells)} {judgement}"


def values(goal: Goal, dives: Sequence[LoggedDive]) -> list[float]:
    """Of the dives that have it."""
    return [value for dive in dives if (value := goal.of(dive)) is not None]


def _cells(goal: Goal, dives: Sequence[LoggedDive]) -> tuple[str, str]:
    found = values(goal, dives)
    if not found:
        return "-", "-"
    return f"{np.median(found):.3g}", f"{max(found):.3g}"


def _goal(goal: Goal, dives: Sequence[LoggedDive]) -> str:
    """Whether the median meets it, and in which log the worst is."""
    known = [(value, dive.name) for dive in dives if (value := goal.of(dive)) is not None]
    if goal.most is None or not known:
        return ""
    least = -np.inf if goal.least is None else goal.least
    met = least <= float(np.median([value for value, _ in known])) <= goal.most
    asked = f"≤ {goal.most:g}" if goal.least is None else f"{goal.least:g} to {goal.most:g}"
    return f"goal {asked}: {'met' if met else 'missed'}; worst in {max(known)[1]}"


def main() -> int:
    folder = os.environ.get(FOLDER)
    if not folder:
        print(NO_FOLDER, file=sys.stderr)
        return 2
    try:
        dives, unknown = read_all(Path(folder))
    except LindyError as error:
        print(error, file=sys.stderr)
        return 2
    print("\n".join(table(dives, unknown)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
