"""The results, one row for each cell; the data and the page are written from them."""

from pathlib import Path
from typing import Literal

import msgspec

from tests.support.faults.fault import FaultCase
from tests.support.faults.figures import Figures
from tests.support.faults.goals import GOALS


class CellRow(msgspec.Struct, frozen=True):
    """One cell."""

    world: Literal["virtual", "real"]
    mode: str
    cause: str
    fault: str
    figures: Figures
    goals: dict[str, bool]  # those that apply: are they met?
    note: str = ""

    @property
    def missed(self) -> list[str]:
        return [name for name, met in self.goals.items() if not met]


def row_of(
    world: Literal["virtual", "real"], mode: str, fault: FaultCase, figures: Figures, note: str = ""
) -> CellRow:
    judged = {goal.name: goal.met(fault, figures) for goal in GOALS}
    goals = {name: met for name, met in judged.items() if met is not None}
    return CellRow(world, mode, fault.cause, fault.name, figures, goals, note)


def write_row(path: Path, row: CellRow) -> None:
    """Append it, so that what was flown is kept when the rest is not."""
    with path.open("ab") as file:
        file.write(msgspec.json.encode(row) + b"\n")


def read_rows(path: Path) -> list[CellRow]:
    decoder = msgspec.json.Decoder(CellRow)
    return [decoder.decode(line) for line in path.read_bytes().splitlines() if line]
