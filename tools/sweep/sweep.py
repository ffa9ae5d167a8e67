"""`lindy sweep`: fly what is missing of a sweep, and show what came of all of it."""

import hashlib
import sys
import time
from collections.abc import Callable, Generator, Sequence, Sized
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import msgspec
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from messages.version import VERSION
from services.runtime.config.errors import EndedByUserError, LindyError
from services.runtime.config.settings import deploy_file
from services.runtime.hosts.registry import Registry
from services.runtime.os import system
from services.tether.io.profile_file import named
from tools.checks import checked, pilot_of
from tools.choices import Choices
from tools.fresh import write_fresh
from tools.live.stop_signals import StopSignals
from tools.live.virtual_dive import without_files
from tools.sweep.all_cores import on_all_cores
from tools.sweep.axes import SweepAxes
from tools.sweep.finished import About, FinishedDives, rows_file
from tools.sweep.one_dive import Job, fly_one, killed_row
from tools.sweep.picture import check_picture, drawn
from tools.sweep.rows import CLEAN, Row
from tools.sweep.tables import check_table, encoded

LINE_S = 10.0  # [s] between two lines where there is no terminal


class Wanted(msgspec.Struct, frozen=True, kw_only=True):
    """What the command line asks for, beside the axes."""

    out: Path
    stack: str
    seconds: float | None = None  # [s] after arming
    workers: int | None = None
    record: bool = False
    picture: Path | None = None


def sweep(axes: SweepAxes, wanted: Wanted) -> int:
    """Returns the exit status.

    Raises:
        LindyError: a wrong value, nowhere to write, a sweep of another kind there; it was
            interrupted; or dives ended with an error.
    """
    check_table(wanted.out)
    if wanted.picture is not None:
        check_picture(wanted.picture)
    if wanted.workers is not None and wanted.workers < 1:
        raise LindyError(f"--workers is {wanted.workers}, expected 1 or more")
    about = _checked(axes, wanted)
    with closing(FinishedDives(wanted.out, about)) as finished:
        try:
            stopped = _fly(axes, wanted, finished)
        except LindyError as error:
            if finished.rows:
                with suppress(LindyError):
                    _write_table(axes, wanted, finished)
            raise LindyError(f"{error}; {_kept(len(finished.rows), axes, wanted)}") from error
        if stopped and not finished.rows:
            raise EndedByUserError(_interrupted(finished.rows, axes, wanted))
        rows = _write_table(axes, wanted, finished)
    _show(rows, axes, wanted)
    return _ending(rows, axes, wanted, stopped=stopped)


def _write_table(axes: SweepAxes, wanted: Wanted, finished: FinishedDives) -> list[Row]:
    """Returns its rows, in the order of the dives."""
    rows = [finished.rows[number] for number in sorted(finished.rows)]
    finished.replace_table(encoded(rows, list(axes.settings), wanted.out.suffix))
    return rows


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def _kept(done: int, axes: SweepAxes, wanted: Wanted) -> str:
    verb = "is" if axes.count == 1 else "are"
    return (
        f"{done} of {_counted(axes.count, 'dive')} {verb} kept in {rows_file(wanted.out)}, and the "
        "same command goes on with the rest"
    )


def _interrupted(rows: Sized, axes: SweepAxes, wanted: Wanted) -> str:
    return f"interrupted; {_kept(len(rows), axes, wanted)}"


def _checked(axes: SweepAxes, wanted: Wanted) -> About:
    """Check every combination before the first dive.

    Raises:
        LindyError: the first mistake found.
    """
    services = without_files(Registry.read(wanted.stack))
    services.require_whole()
    files: dict[str, str] = {str(services.file): _checksum(services.file)}
    for vehicle, link, pilot, settings in axes.combinations():
        choice = pilot_of(pilot)
        if choice.script_s is None:
            raise LindyError(f"--pilot {pilot} needs real time; a sweep flies script:FILE only")
        choices = Choices(
            vehicle=vehicle, link=link, pilot=pilot, seconds=wanted.seconds, set_=settings
        )
        stack = checked(choices, choice, services)
        script = deploy_file("dives", pilot.partition(":")[2], ".csv")
        for path in (stack.vehicle_path, named(link).path, script):
            files[str(path)] = _checksum(path)
    return {
        "lindy": VERSION,
        "stack": wanted.stack,
        "seconds": wanted.seconds,
        "record": wanted.record,
        **{f"--{name}": getattr(axes, name) for name in ("vehicle", "link", "pilot", "seed")},
        "--set": axes.settings,
        "files": files,
    }


def _checksum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def _fly(axes: SweepAxes, wanted: Wanted, finished: FinishedDives) -> bool:
    """Fly what is missing. Was it interrupted?"""
    keep = str(wanted.out.with_name(f"{wanted.out.name}.dives")) if wanted.record else ""
    jobs = [
        Job(dive, wanted.stack, wanted.seconds, keep)
        for dive in axes.dives()
        if dive.number not in finished.rows
    ]
    workers = min(wanted.workers or system.cores(), max(1, len(jobs)))
    before = len(finished.rows)
    there = f", {before} of them done before" if before else ""
    flown, used = _counted(axes.count, "dive"), _counted(workers, "core")
    print(f"{flown}{there}, on {used} → {wanted.out}", flush=True)
    with StopSignals() as stop, _progress(axes.count, before) as advance:
        for result in on_all_cores(fly_one, jobs, workers, lambda: stop.asked, killed_row):
            if result is not None and (row := result[1]) is not None:
                finished.add(row)
            advance(len(finished.rows))
        return stop.asked


@contextmanager
def _progress(total: int, before: int) -> Generator[Callable[[int], None]]:
    """A progress bar on a terminal, otherwise a line every `LINE_S`."""
    if not sys.stdout.isatty():
        yield _lines(total, before)
        return
    columns = TextColumn("diving"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, transient=True) as bar:
        task = bar.add_task("diving", total=total, completed=before)
        yield lambda done: bar.update(task, completed=done)


def _lines(total: int, before: int) -> Callable[[int], None]:
    last = began = time.monotonic()

    def advance(done: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last < LINE_S:
            return
        last = now
        left = (total - done) * (now - began) / (done - before) if done > before else None
        rest = "" if left is None else f", about {left:.0f} s to go"
        print(f"{done} of {_counted(total, 'dive')}{rest}", flush=True)

    return advance


def _show(rows: Sequence[Row], axes: SweepAxes, wanted: Wanted) -> None:
    print(f"written {wanted.out} ({_counted(len(rows), 'row')})", flush=True)
    if wanted.picture is not None and rows and len(rows) == axes.count:
        wanted.picture.parent.mkdir(parents=True, exist_ok=True)
        write_fresh(wanted.picture, drawn(rows, axes.varied), "--picture")
        print(f"written {wanted.picture}", flush=True)


def _ending(rows: Sequence[Row], axes: SweepAxes, wanted: Wanted, *, stopped: bool) -> int:
    if stopped and len(rows) < axes.count:
        raise EndedByUserError(_interrupted(rows, axes, wanted))
    failed = [row for row in rows if row["end"] != CLEAN]
    if failed:
        raise LindyError(
            f"{len(failed)} of {_counted(len(rows), 'dive')} ended with an error; the first, dive "
            f"{failed[0]['dive']}: {failed[0]['end']}"
        )
    return 0
