"""docs/faults.md from the rows. Pure."""

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence

from tests.support.faults.figures import Figures
from tests.support.faults.goals import GOALS
from tests.support.faults.rows import CellRow

WORLDS = {"virtual": "on virtual time", "real": "real processes"}
HEAD = """# The fault matrix

Written by `python -m tests.support.faults`; do not edit. Every fault in every mode: what the
drone does, what the pilot reads, which goals are missed. A figure in **bold** misses its goal.

On virtual time each fault meets each mode: with the simulator, the tether's model and the
decisions of the real supervisor; a service takes 0.35 s to start there. In real processes (`lindy
dive`) some are done again, with signals, disks and processors, in the mode stabilised. Truth is the
simulator's. All times are in seconds from the beginning of the fault, however long it lasts. A
dash: it did not happen, or does not apply.

The pilot is a script, which resumes by itself as soon as a failsafe can be ended
(docs/failsafes.md); a person's time to press the button comes on top of **in control**. On virtual
time the drone rises after 8 s without a pilot instead of 60, and its depth limit is within reach:
4, 6 or 11 m.
"""
COLUMNS = (
    "fault", "reaction", "said [s]", "depth [m]", "jerk [-]", "stale", "pilot gone [s]",
    "thrust zero [s]", "in control [s]", "disarm [s]", "misses",
)  # fmt: skip
MEANING = """
- **said**: the first line that the pilot can read: status, link alarm, log line above information.
- **depth**: largest distance from where the reference wanted the drone, while a depth was held.
  Without a reference nothing should move: one that was moving is measured from where that ended.
  Judged where samples arrive: not without the vehicle side or the drone's hub.
- **jerk**: of the reference over its limit, of depth and heading the worse.
- **stale**: actuations of a command, or of a stick position behind it, beyond its life.
- **pilot gone**: the drone's status says so.
- **thrust zero**: the thrusters stop for want of commands.
- **in control**: from when on the pilot's commands reach the thrusters, without a failsafe: the
  pilot has resumed where one acted.
- **disarm**: from a request 0.3 s into the fault (in another dive, the same until then) until no
  thruster turns. A request is repeated for 5 s, so a service that is started again may grant it.
"""
NOT_COVERED = """
## Not observable

- No driver measures the thrust of a thruster, so one that is dead, weak or turns the wrong way is
  not announced: the pilot sees it by what the drone does. A drone with a single vertical thruster
  cannot hold its depth without it.
- A hub that hangs for 0.3 s delays messages, and nothing expires that matters: no service is late.
- A recorder or a viewer that hangs for 0.3 s loses nothing, because it takes what arrived from a
  ring of a second and more; and four busy processes that make no service late cost nothing.

## Physics

- A drone that moves, or floats up, goes on while what commands it is dead or hangs: 0.1 to 0.25 m
  until the service is started again.

## Not mended

- Two processes that both call themselves `reference` answer the pilot by turns, each in the name of
  an epoch of its own. A disarm has the epoch of one of them: it is refused as that of another pilot
  where the other is the one that is heard. The screens say that there are two, and nothing arms
  then; ending either of them ends it. A supervisor never starts a second one.
- A disarm does not get through a cable that is out. The drone stops by itself.

## Not covered

- A jump of the computer's clock: every service runs on the monotonic clock, and a test must not set
  the clock of a computer that others use.
- On virtual time an exception ends a service between two handlers, and what a slow service
  publishes comes at the beginning of its step. Recorder, viewer, supervisor, disks and processors
  exist in real processes alone.
- A peer with another version of the keys, or without a certificate, never gets in
  (tests/services/runtime/bus/). Here a stranger and an older pilot speak on the topside's own bus.
"""
FOLDER = re.compile(r"/\S*lindy-faults-[^/ ]*/")  # of the run, in what was read
Missed = tuple[str, str]  # goal, fault


def page_of(rows: Sequence[CellRow], planned: int, conditions: str) -> str:
    """
    Args:
        planned: cells that there are on virtual time.
        conditions: of the run, in a sentence.
    """
    count = Counter(row.world for row in rows)
    flown = f"all {planned}" if count["virtual"] == planned else f"{count['virtual']} of {planned}"
    cells = (
        f"\nFlown: {flown} cells on virtual time, {count['real']} in real processes. {conditions}\n"
    )
    parts = [HEAD, cells, *_goals(rows), *_missed(rows), "\n## What is measured\n", MEANING]
    for world, words in WORLDS.items():
        for mode in dict.fromkeys(row.mode for row in rows if row.world == world):
            parts.append(f"\n## {mode}, {words}\n\n")
            parts += _table(
                COLUMNS, [_cells(r) for r in rows if (r.world, r.mode) == (world, mode)]
            )
    return "".join([*parts, *_read(rows), NOT_COVERED])


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


def _goals(rows: Sequence[CellRow]) -> list[str]:
    table: list[list[str]] = []
    for goal in GOALS:
        cells = [goal.words]
        for world in WORLDS:
            met, judged = _met([row for row in rows if row.world == world], goal.name)
            cells.append(f"{met} of {judged}" if met == judged else f"**{met} of {judged}**")
        table.append(cells)
    return ["\n## Goals\n\n", *_table(("goal", *WORLDS.values()), table)]


def _missed(rows: Sequence[CellRow]) -> list[str]:
    """By goal and fault: the modes, with the figure in each."""
    found: defaultdict[Missed, list[str]] = defaultdict(list)
    for row in rows:
        for goal in row.missed:
            where = row.mode if row.world == "virtual" else f"real {row.mode}"
            figure = FIGURES[goal](row.figures) if goal in FIGURES else ""
            found[goal, row.fault].append(f"{where} {figure}".strip())
    table = [[goal, fault, ", ".join(where)] for (goal, fault), where in sorted(found.items())]
    return ["\n## What misses\n\n", *_table(("goal", "fault", "where"), table)]


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


FIGURES: dict[str, Callable[[Figures], str]] = {
    "announced": lambda f: _number(f.announced),
    "depth": lambda f: _number(f.depth_error, 3),
    "jerk": lambda f: _number(f.jerk_ratio, 3),
    "stale": lambda f: str(f.stale),
    "pilot": lambda f: _number(f.pilot_lost),
    "thrust": lambda f: _number(f.thrust_zero),
    "back": lambda f: _number(f.recovered),
    "disarm": lambda f: _number(f.disarmed) if f.asked else "not asked",
}


def _cells(row: CellRow) -> list[str]:
    def shown(goal: str) -> str:
        text = FIGURES[goal](row.figures)
        return f"**{text}**" if row.goals.get(goal) is False else text

    name = row.fault if not row.note else f"{row.fault} ({row.note})"
    return [name, _reaction(row.figures), *map(shown, FIGURES), ", ".join(row.missed)]


def _reaction(figures: Figures) -> str:
    parts = [name.replace("_", " ") for name in figures.failsafes]
    parts += [f"{name} started again" for name in figures.restarted]
    parts += [] if figures.still_armed else ["disarmed"]
    return ", ".join(parts) or "–"


def _read(rows: Sequence[CellRow]) -> list[str]:
    """By fault, over all modes."""
    texts: defaultdict[str, dict[str, None]] = defaultdict(dict)
    for row in rows:
        read = [FOLDER.sub("", text) for text in row.figures.texts]
        texts[row.fault].update(dict.fromkeys(read))
    table = [[fault, "; ".join(words) or "**nothing**"] for fault, words in texts.items()]
    return ["\n## What the pilot reads\n\n", *_table(("fault", "in any mode"), table)]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [list(heads), ["---"] * len(heads), *rows]
    return [f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines]
