"""What is expected of every cell, and a row for each with what it misses, from which the data and
the page are written."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec

from tests.support.faults.catalogue import NONE, FaultCase
from tests.support.faults.cells import FlownCell
from tests.support.faults.figures import STEP_NS, Figures

STEP_S = STEP_NS / 1e9
DEPTH_M = 0.1
JERK = 1.0005  # [-] shown as 1.000
PILOT_S = 0.3 + STEP_S
THRUST_S = 0.25


class Goal(NamedTuple):
    name: str
    words: str  # for the page
    met: Callable[[FaultCase, Figures], bool | None]  # None: there is nothing to judge


def _depth(fault: FaultCase, figures: Figures) -> bool | None:
    if not fault.lives or figures.depth_error is None:
        return None
    return figures.depth_error <= DEPTH_M


def _jerk(_: FaultCase, figures: Figures) -> bool | None:
    return None if figures.jerk_ratio is None else figures.jerk_ratio <= JERK


def _stale(_: FaultCase, figures: Figures) -> bool | None:
    return figures.stale == 0


def _pilot(fault: FaultCase, figures: Figures) -> bool | None:
    return _within(figures.pilot_lost, PILOT_S) if fault.no_pilot else None


def _thrust(fault: FaultCase, figures: Figures) -> bool | None:
    return _within(figures.thrust_zero, THRUST_S) if fault.no_control else None


def _back(fault: FaultCase, figures: Figures) -> bool | None:
    return None if fault.back is None else _within(figures.recovered, fault.back)


def _disarm(_: FaultCase, figures: Figures) -> bool | None:
    return figures.disarmed is not None if figures.asked else None


def _announced(fault: FaultCase, figures: Figures) -> bool | None:
    """Of a thruster nobody can know: no driver measures its thrust."""
    return None if fault is NONE or fault.cause == "thruster" else figures.announced is not None


def _within(seconds: float | None, limit: float) -> bool:
    return seconds is not None and seconds <= limit


GOALS = (
    Goal("depth", "a held depth is held within 0.1 m, where the sensors live", _depth),
    Goal("jerk", "largest jerk of the reference at most 1.000 of its limit", _jerk),
    Goal("stale", "no expired command reaches a thruster", _stale),
    Goal("pilot", "the drone knows within 0.31 s that the pilot is gone", _pilot),
    Goal("thrust", "thrusters stopped within 0.25 s when control ends or hangs", _thrust),
    Goal(
        "back",
        "in control again 1.5 s after a kill, 3 s after a hang, 2 s after what made the drone act "
        "has ended",
        _back,
    ),
    Goal("disarm", "disarm asked for during the fault takes effect", _disarm),
    Goal("announced", "the pilot reads something", _announced),
)


class CellRow(msgspec.Struct, frozen=True):
    """One cell."""

    mode: str
    cause: str
    fault: str
    figures: Figures
    goals: dict[str, bool]  # those that apply: are they met?

    @property
    def missed(self) -> list[str]:
        return [name for name, met in self.goals.items() if not met]


def row_of(flown: FlownCell) -> CellRow:
    (mode, fault), found = flown
    judged = {goal.name: goal.met(fault, found) for goal in GOALS}
    goals = {name: met for name, met in judged.items() if met is not None}
    return CellRow(mode.name, fault.cause, fault.name, found, goals)


def write_row(path: Path, row: CellRow) -> None:
    """Append it, so that what was flown is kept when the rest is not."""
    with path.open("ab") as file:
        file.write(msgspec.json.encode(row) + b"\n")


def read_rows(path: Path) -> list[CellRow]:
    decoder = msgspec.json.Decoder(CellRow)
    return [decoder.decode(line) for line in path.read_bytes().splitlines() if line]
