"""`python -m tests.support.faults`: fly the fault matrix.

Writes research/measurements/faults* and, from those, docs/faults.md.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from services.runtime.os import system
from tests.support.faults.cells import CELLS, fly_all
from tests.support.faults.goals import CellRow, read_rows, row_of, write_row
from tests.support.faults.page import DATA, PAGE, page, summary, write_data


def main(words: Sequence[str]) -> int:
    """Returns 0, also where cells miss goals: the table says which."""
    parser = argparse.ArgumentParser(prog="faults", description=__doc__)
    parser.add_argument("--cells", nargs="*", default=[], help="as MODE/FAULT; else all")
    parser.add_argument("--rows", type=Path, help="file for the rows, one line of JSON each")
    parser.add_argument("--read", type=Path, nargs="*", help="fly nothing: rows of earlier runs")
    args = parser.parse_args(words)
    began = time.monotonic()
    if args.read:
        rows = [row for path in args.read for row in read_rows(path)]
    else:
        rows = flown(args.cells, args.rows)
    conditions = f"{(time.monotonic() - began) / 60.0:.0f} minutes on {system.cores()} cores."
    print(summary(rows))
    if args.read or not args.cells:
        write_data(rows, len(CELLS), conditions)
        PAGE.write_text(page(), encoding="utf-8")
        print(f"written: {DATA}/faults*, {PAGE}")
    return 0


def flown(names: Sequence[str], kept: Path | None) -> list[CellRow]:
    """Fly the cells; `kept`: file to which each row is added at once. Cells that are in it already,
    of a run that was broken off, are not flown again."""
    kept = kept or Path(tempfile.mkdtemp(prefix="lindy-faults-")) / "rows.jsonl"
    rows = read_rows(kept) if kept.exists() else []
    known = {f"{row.mode}/{row.fault}" for row in rows}
    cells = {f"{cell.mode.name}/{cell.fault.name}": cell for cell in CELLS}
    chosen = [cells[name] for name in names or cells if name not in known]
    for each in fly_all(chosen, system.cores()):
        rows.append(row := row_of(each))
        write_row(kept, row)
        missed = f"  MISSED {', '.join(row.missed)}" if row.missed else ""
        print(f"{row.mode:17}{row.fault}{missed}", flush=True)
    print(f"rows: {kept}")
    return rows


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
