"""`python -m lindy_research.bench`, which is `make bench`: measure everything while nobody else
works, judge it beside the last figures, keep it in research/measurements/performance.json and
write its table into performance.md beside that.

Exit status 1: a figure is worse than the last by more than its noise; such a section is not kept,
unless --accept says so. Or a section could not be measured, whose last figures stay. Figures that
were measured while others worked are judged by nobody, and take the place of quiet ones only with
--accept.
"""

import argparse
import os
import platform
import sys
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import msgspec

from lindy.api import LindyError
from lindy_research.bench import SECTIONS
from lindy_research.bench.record import (
    QUIET,
    KeptFigure,
    cores_at_work,
    kept,
    merged,
    noisier,
    with_table,
    worse,
)
from lindy_research.bench.table import Figure, show

STAT = Path("/proc/stat")
MEASUREMENTS = Path(__file__).parents[2] / "measurements"
LOOK_S = 3.0  # [s] over which the work of others is measured
PATIENCE_S = 600.0  # [s] until a busy machine is refused


def main(words: Sequence[str], folder: Path = MEASUREMENTS) -> int:
    parser = argparse.ArgumentParser(
        prog="make bench", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--only", nargs="*", default=[*SECTIONS], choices=[*SECTIONS])
    parser.add_argument("--runs", type=int, default=3, help="of each section; default: 3")
    parser.add_argument("--busy", action="store_true", help="measure, whatever else works")
    parser.add_argument("--accept", action="store_true", help="keep also what is worse")
    args = parser.parse_args(words)
    record, page = folder / "performance.json", folder / "performance.md"
    if not page.exists():
        parser.error(f"{page} is not there: figures are kept in a clone; `lindy bench` shows them")
    last = _read(record)
    said = False
    for name in args.only:
        try:
            now = _measured(name, args.runs, busy=args.busy)
        except (LindyError, OSError, RuntimeError, ImportError) as error:
            print(f"{name}: not measured: {error}", flush=True)
            said = True
            continue
        found = worse(last, now)
        for old, new in found:
            print(
                f"{name}: {new.name}: ratio {new.ratio:.3g}, last {old.ratio:.3g}, noise "
                f"{old.noise + new.noise:.2g}: worse",
                flush=True,
            )
        said = said or (bool(found) and not args.accept)
        if noisy := not args.accept and noisier(last, now):
            print(f"{name}: not kept: the last figures were measured while nobody else worked")
        if args.accept or not (found or noisy):
            last = merged(last, now)
            numbers = msgspec.json.encode(last, enc_hook=float)  # some are numpy's
            record.write_bytes(msgspec.json.format(numbers, indent=1) + b"\n")
            page.write_text(with_table(page.read_text(encoding="utf-8"), last), encoding="utf-8")
    return int(said)


def _read(record: Path) -> list[KeptFigure]:
    if not record.exists():
        return []
    return msgspec.json.decode(record.read_bytes(), type=list[KeptFigure])


def _measured(name: str, runs: int, *, busy: bool) -> list[KeptFigure]:
    """
    Raises:
        LindyError: others work on this machine.
    """
    section, others = import_module(SECTIONS[name]), 0.0
    found: list[list[Figure]] = []
    for run in range(1, runs + 1):
        others = max(others, _others(busy=busy))
        print(f"{name}: run {run} of {runs}; others: {others:.1f} cores", flush=True)
        found.append(section.figures())
        show(found[-1])
    python = ".".join(platform.python_version_tuple()[:2])
    machine = f"{len(os.sched_getaffinity(0))} cores, {platform.machine()}, Python {python}"
    return kept(found, round(others, 2), machine)


def _others(*, busy: bool) -> float:
    """[cores] of other work, once it is quiet or, where that is not asked for, as it is.

    Raises:
        LindyError: it does not become quiet.
    """
    until = time.monotonic() + PATIENCE_S
    while True:
        cores = _cores_at_work()
        if busy or cores <= QUIET:
            return cores
        if time.monotonic() > until:
            raise LindyError(
                f"other work takes {cores:.1f} cores, allowed are {QUIET:g}; --busy measures in "
                f"spite of it, and what it finds is judged by nobody"
            )


def _cores_at_work() -> float:
    before = STAT.read_text(encoding="ascii")
    time.sleep(LOOK_S)  # so that it is others who work
    return cores_at_work(before, STAT.read_text(encoding="ascii"), os.cpu_count() or 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
