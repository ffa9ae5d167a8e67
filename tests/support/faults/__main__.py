"""`python -m tests.support.faults`: fly the fault matrix.

Writes research/measurements/faults* and, from those, docs/faults.md.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Collection, Generator, Sequence
from pathlib import Path

from services.runtime.os import system
from tests.support.faults import real_cells, virtual_cells
from tests.support.faults.page import DATA, PAGE, page_of, summary, write_data
from tests.support.faults.rows import CellRow, read_rows, row_of, write_row
from tests.support.faults.virtual_cells import VirtualCell

PLANNED = len(virtual_cells.ALL)


def main(words: Sequence[str]) -> int:
    """Returns 0, also where cells miss goals: the table says which."""
    parser = argparse.ArgumentParser(prog="faults", description=__doc__)
    parser.add_argument("--world", choices=("virtual", "real", "both"), default="both")
    parser.add_argument("--cells", nargs="*", default=[], help="virtual ones, as MODE/FAULT")
    parser.add_argument("--rows", type=Path, help="file for the rows, one line of JSON each")
    parser.add_argument("--read", type=Path, nargs="*", help="fly nothing: rows of earlier runs")
    parser.add_argument("--workers", type=int, default=system.cores())
    args = parser.parse_args(words)
    if args.read:
        rows = [row for path in args.read for row in read_rows(path)]
        _keep(rows, _conditions())
        print(summary(rows))
        return 0
    began = time.monotonic()
    rows = flown(args.world, args.cells, args.workers, args.rows)
    minutes = (time.monotonic() - began) / 60.0
    print(f"{summary(rows)}\n{minutes:.1f} min")
    if args.world == "both" and not args.cells:
        _keep(rows, f"{minutes:.0f} minutes, {_conditions()}")
    return 0


def _keep(rows: Sequence[CellRow], conditions: str) -> None:
    write_data(rows, PLANNED, conditions)
    PAGE.write_text(page_of(), encoding="utf-8")
    print(f"written: {DATA}/faults*, {PAGE}")


def _conditions() -> str:
    """Real processes start late on a busy computer."""
    return f"{system.cores()} cores, with {os.getloadavg()[2]:.0f} processes at work on average."


def flown(world: str, names: Sequence[str], workers: int, kept: Path | None) -> list[CellRow]:
    """Fly the cells; `kept`: file to which each row is added at once. Virtual cells that are in it
    already, of a run that was broken off, are not flown again."""
    if kept is None:
        kept = Path(tempfile.mkdtemp(prefix="lindy-faults-")) / "rows.jsonl"
    rows = read_rows(kept) if kept.exists() else []
    known = {f"{row.mode}/{row.fault}" for row in rows if row.world == "virtual"}
    for row in _flying(world, names, workers, known):
        rows.append(row)
        write_row(kept, row)
        missed = f"  MISSED {', '.join(row.missed)}" if row.missed else ""
        print(f"{row.world:8}{row.mode:17}{row.fault}{missed}", flush=True)
    print(f"rows: {kept}")
    return rows


def _flying(
    world: str, names: Sequence[str], workers: int, known: Collection[str]
) -> Generator[CellRow]:
    if world != "real":
        for (mode, fault), figures in virtual_cells.fly_all(_chosen(names, known), workers):
            yield row_of("virtual", mode.name, fault, figures)
    if world != "virtual":
        for fault, figures, note in real_cells.fly_all():
            yield row_of("real", real_cells.PILOTED.name, fault, figures, note)


def _chosen(names: Sequence[str], known: Collection[str]) -> list[VirtualCell]:
    cells = {f"{mode.name}/{fault.name}": (mode, fault) for mode, fault in virtual_cells.ALL}
    return [VirtualCell(*cells[name]) for name in names or cells if name not in known]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
