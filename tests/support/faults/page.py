"""The matrix as data (research/measurements/faults*), and docs/faults.md from it (`make docs`)."""

import csv
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import msgspec

from tests.support.faults.figures import Figures
from tests.support.faults.goals import GOALS, CellRow

DATA = Path(__file__).parents[3] / "research" / "measurements"
PAGE = Path(__file__).parents[3] / "docs" / "faults.md"
CELLS, READ, FLOWN = "faults.csv", "faults_read.csv", "faults.json"
WORLDS = {"virtual": "virtual time", "real": "real processes"}
FOLDER = re.compile(r"/\S*lindy-faults-[^/ ]*/")  # of the run, in what was read


class GoalCount(msgspec.Struct, frozen=True):
    """How many cells meet a goal."""

    goal: str
    words: str
    world: str
    met: int
    judged: int


class FlownMatrix(msgspec.Struct, frozen=True):
    """What was flown, and how well it did."""

    planned: int  # cells that there are on virtual time
    conditions: str  # of the run, in a sentence
    goals: list[GoalCount]


Cell = dict[str, str]  # a line of the table of cells; "": it did not happen, or does not apply


def _number(value: float | None, digits: int = 2) -> str:
    return "" if value is None else f"{value:.{digits}f}"


FIGURES: dict[str, Callable[[Figures], str]] = {
    "said_s": lambda f: _number(f.announced),
    "depth_m": lambda f: _number(f.depth_error, 3),
    "jerk": lambda f: _number(f.jerk_ratio, 3),
    "stale": lambda f: str(f.stale),
    "pilot_gone_s": lambda f: _number(f.pilot_lost),
    "thrust_zero_s": lambda f: _number(f.thrust_zero),
    "in_control_s": lambda f: _number(f.recovered),
    "disarm_s": lambda f: _number(f.disarmed) if f.asked else "not asked",
}
COLUMNS = ("world", "mode", "fault", "note", "reaction", *FIGURES, "missed")


def write_data(rows: Sequence[CellRow], planned: int, conditions: str, folder: Path = DATA) -> None:
    """What was once done in real processes stays as it is.

    Args:
        planned: cells that there are on virtual time.
        conditions: of the run, in a sentence.
    """
    once, real = list[GoalCount](), list[list[str]]()
    if (folder / CELLS).exists():
        once = [goal for goal in flown(folder).goals if goal.world == "real"]
        real = [[*cell.values()] for cell in cells(folder) if cell["world"] == "real"]
    _write(folder / CELLS, COLUMNS, [*map(_cell, rows), *real])
    texts: defaultdict[str, dict[str, None]] = defaultdict(dict)
    for row in rows:
        texts[row.fault].update(dict.fromkeys(FOLDER.sub("", text) for text in row.figures.texts))
    _write(folder / READ, ("fault", "read"), ((name, "; ".join(t)) for name, t in texts.items()))
    goals = [GoalCount(goal.name, goal.words, "virtual", *_met(rows, goal.name)) for goal in GOALS]
    told = msgspec.json.encode(FlownMatrix(planned, conditions, [*goals, *once]))
    (folder / FLOWN).write_bytes(msgspec.json.format(told, indent=1) + b"\n")


def _write(path: Path, heads: Sequence[str], lines: Iterable[Sequence[str]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([heads, *lines])


def _cell(row: CellRow) -> list[str]:
    figures = [shown(row.figures) for shown in FIGURES.values()]
    reaction = _reaction(row.figures)
    return ["virtual", row.mode, row.fault, "", reaction, *figures, ", ".join(row.missed)]


def _reaction(figures: Figures) -> str:
    parts = [name.replace("_", " ") for name in figures.failsafes]
    parts += [f"{name} started again" for name in figures.restarted]
    parts += [] if figures.still_armed else ["disarmed"]
    return ", ".join(parts)


def cells(folder: Path = DATA) -> list[Cell]:
    with (folder / CELLS).open(encoding="utf-8", newline="") as file:
        return [*csv.DictReader(file)]


def flown(folder: Path = DATA) -> FlownMatrix:
    return msgspec.json.decode((folder / FLOWN).read_bytes(), type=FlownMatrix)


def summary(rows: Sequence[CellRow]) -> str:
    """In a few lines, for a terminal."""
    lines = [f"{len(rows)} cells, {sum(bool(row.missed) for row in rows)} miss a goal"]
    for goal in GOALS:
        met, judged = _met(rows, goal.name)
        lines.append(f"  {goal.name:<10}{met:4} of {judged:4}  {goal.words}")
    return "\n".join(lines)


def _met(rows: Iterable[CellRow], goal: str) -> tuple[int, int]:
    judged = [row.goals[goal] for row in rows if goal in row.goals]
    return sum(judged), len(judged)


# The page.

BOARD = "(simulator|estimation|reference|control)"
TOPSIDE = "(tether|gamepad|link_monitor)"
KINDS = {  # of faults, by their names; the first that fits counts
    f"(kill -9|exception in) {BOARD}": "a service on board dies",
    f"(kill -9|exception in) {TOPSIDE}": "a service topside dies",
    "kill -9 hub": "a hub dies",
    "kill -9 supervisor": "the supervisor dies",
    f"SIGSTOP {BOARD} 0.3 s": "a service on board hangs for 0.3 s",
    f"SIGSTOP {BOARD}": "… for 2 s or more",
    f"SIGSTOP {TOPSIDE}": "a service topside hangs",
    "SIGSTOP hub": "a hub hangs",
    "(SIGSTOP|kill -9) (recorder|visualizer)": "recorder or viewer dies, hangs",
    ".*ten times too slow": "a service is ten times too slow",
    "busy processor|4 busy": "a busy computer",
    "drone side restarted": "the drone's side restarts without its memory",
    "cable out 3 s": "the cable is out for 3 s",
    "cable out": "… for 30 s",
    "link (congested|severe)": "a worse link",
    "pilot silent": "the pilot is silent for 22 s",
    "flood|stranger|pilot of an older": "strangers, floods, an older version",
    "second|another Lindy": "a service, or Lindy, runs twice",
    "imu": "the IMU fails",
    "pressure": "the pressure sensor fails",
    "magnetometer": "the compass fails",
    "(port|lateral|vertical) ": "a thruster fails",
    "leak|battery (critical|empty)": "leak, empty battery",
    "battery low|temperature": "low battery, heat",
    "stick down|goto": "beyond the depth limit",
    "disk full|folder removed": "disk full, folder removed",
}
HEAD = """# Faults

Written by `python -m tests.support.faults` from `research/measurements/faults.csv`, which has
every cell; do not edit.

Every fault meets every mode on virtual time; some were done again, once, in real processes, with
signals, disks and processors. The pilot is a script, which resumes by itself when a
[failsafe](failsafes.md) can be ended; a person's time to do so comes on top. On virtual time the
drone rises after 8 s without a pilot instead of 60.
"""
BY_FAULT = """
## By fault

The worst of all modes, in seconds from the beginning of the fault: until the pilot **reads**
something, and until the pilot's commands reach the thrusters **again** (a dash: never). *Misses*:
cells that miss a goal.

"""
NOTES = """
What the pilot reads, word for word: `research/measurements/faults_read.csv`.

## What misses

- **announced**: no driver measures thrust, so a thruster that is dead, weak or reversed is not
  announced: the pilot sees it by what the drone does. A recorder or viewer that hangs for 0.3 s
  loses nothing.
- **depth**: a drone with one vertical thruster cannot hold its depth without it. One that moves or
  floats up goes on while what commands it is dead or hangs, for 0.1 to 0.25 m.
- **disarm**: it does not get through a cable that is out; the drone stops by itself. Two processes
  that both call themselves `reference` answer by turns, so a disarm may be refused. The screens
  say that there are two, and nothing arms then; ending either ends it. A supervisor never starts a
  second one.

## Not covered

A jump of the computer's clock (every service runs on the monotonic clock), and an exception within
a handler on virtual time. Who has no certificate: [security](security.md).
"""


def page(folder: Path = DATA) -> str:
    """docs/faults.md, from the data in `folder`."""
    every, run = cells(folder), flown(folder)
    count = Counter(cell["world"] for cell in every)
    share = f"all {run.planned}" if count["virtual"] == run.planned else f"{count['virtual']}"
    flew = f"\nFlown: {share} cells on virtual time, {count['real']} in real processes; "
    goals = _table(("goal", *WORLDS.values()), _goals(run.goals))
    kinds = _table(("fault", "the drone", "reads", "again", "misses"), _kinds(every))
    return "".join(
        [HEAD, flew, run.conditions, "\n\n## Goals\n\n", *goals, BY_FAULT, *kinds, NOTES]
    )


def _goals(goals: Sequence[GoalCount]) -> list[list[str]]:
    by_goal: defaultdict[str, list[str]] = defaultdict(list)
    for goal in goals:
        met = f"{goal.met} of {goal.judged}"
        by_goal[goal.words].append(met if goal.met == goal.judged else f"**{met}**")
    return [[words, *counts] for words, counts in by_goal.items()]


def _kinds(every: Sequence[Cell]) -> list[list[str]]:
    """A line for each kind of fault; what fits none is a mistake."""
    kinds: dict[str, list[Cell]] = {pattern: [] for pattern in KINDS}
    for cell in every:
        if cell["fault"] != "none":
            kinds[next(k for k in KINDS if re.match(k, cell["fault"]))].append(cell)
    return [[KINDS[kind], *_kind(found)] for kind, found in kinds.items() if found]


def _kind(found: Sequence[Cell]) -> list[str]:
    did: dict[str, None] = {}
    for cell in found:
        words = (cell["reaction"] or cell["note"]).split(", ")
        did.update(dict.fromkeys(re.sub(r"^\w+ (?=started again)", "", word) for word in words))
    missed = Counter(goal for cell in found for goal in cell["missed"].split(", ") if goal)
    misses = ", ".join(f"{goal} {count}" for goal, count in missed.items())
    worst = [_worst(found, figure) for figure in ("said_s", "in_control_s")]
    return [", ".join(filter(None, did)) or "goes on", *worst, misses]


def _worst(found: Iterable[Cell], figure: str) -> str:
    told = [float(cell[figure]) for cell in found if cell[figure]]
    return f"{max(told):.1f}" if told else "–"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [list(heads), ["---"] * len(heads), *rows]
    return [f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines]
