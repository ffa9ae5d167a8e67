"""`lindy sweep`: fly what is missing of a sweep, and show what came of all of it."""

import hashlib
import time
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from messages.version import VERSION
from services.runtime.config.errors import EndedByUserError, LindyError
from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.os import system
from services.tether.io.profile_file import named
from tools.checks import checked, pilot_of, read_besides
from tools.choices import Choices, NewFile, NewPicture, Overrides, StackName, Whole
from tools.fresh import require_picture, write_fresh
from tools.live.dive_timeline import DiveTimeline
from tools.live.outcome import Outcome
from tools.live.stop_signals import StopSignals
from tools.live.virtual_dive import INTERRUPTED, MemoryRecorder, fly, without_files
from tools.sweep.all_cores import asked_to_stop, on_all_cores
from tools.sweep.axes import PlannedDive, SweepAxes, axes
from tools.sweep.rows import (
    CLEAN,
    About,
    FinishedDives,
    Flown,
    Row,
    drawn,
    encoded,
    require_unedited,
    row_of,
    rows_file,
)

LINE_S = 10.0  # [s] between two lines where there is no terminal
Values = tuple[str, ...]


class Wanted(msgspec.Struct, frozen=True, kw_only=True):
    """What the command line asks for."""

    axes: SweepAxes
    out: Path
    stack: str
    seconds: float | None  # [s] after arming
    workers: int | None


class Job(NamedTuple):
    """What a worker needs to fly one dive."""

    dive: PlannedDive
    stack: str  # a name or a file, as --stack
    seconds: float | None  # [s] after arming


def fly_one(job: Job) -> Row | None:
    """The row of a dive, whatever happens in it; None: it was interrupted."""
    if asked_to_stop():
        return None
    began, flown = time.perf_counter(), None
    try:
        with TemporaryDirectory(prefix="lindy-") as folder:  # for a service that writes files
            flown = _flown(job, folder)
        end = flown.report.exit
    except LindyError as error:
        end = str(error)
    except Exception as error:  # a mistake in one dive does not end the others
        end = f"an error in this dive: {type(error).__name__}: {error}"
    if end == INTERRUPTED:
        return None
    return row_of(job.dive, flown, " ".join(end.split()), time.perf_counter() - began)


def _flown(job: Job, folder: str) -> Flown:
    combination = job.dive.combination
    pilot = pilot_of(combination.pilot)
    services = without_files(Registry.read(job.stack))
    stack = Stack(
        vehicle=combination.vehicle,
        link=combination.link,
        pilot=pilot.name,
        seed=job.dive.seed,
        overrides=list(combination.settings),
        services=job.stack,
        running=list(services),
        seconds=job.seconds,
        virtual=True,
        out=folder,
    )
    besides = read_besides(stack, pilot.incidents, pilot.courses)
    stack = msgspec.structs.replace(stack, read_besides=besides)
    outcome, memory = Outcome(stack), MemoryRecorder()
    timeline = DiveTimeline(pilot.script_s, job.seconds)
    fly(stack, services, timeline, outcome, stop=asked_to_stop, memory=memory)
    dive = memory.dive()
    return Flown(outcome.report_in_memory(dive, memory.log_hash()), dive.max_depth_m)


def sweep(
    *,
    out: NewFile,
    seed: Values = ("0",),
    set_: Overrides = (),
    vehicle: Values = ("pioneer",),
    link: Values = ("tether",),
    pilot: Values = ("script:first_dive",),
    stack: StackName = "simulated",
    seconds: float | None = None,
    workers: Whole | None = None,
    picture: NewPicture = None,
) -> int:
    """Simulate many dives on all cores, into one table.

    One row of figures per dive. The options are those of `lindy simulate`, with several values
    between commas where wanted. The sweep is their product. A dive has neither files nor a viewer.
    After an interruption the same command goes on with what is missing.

    Example: lindy sweep --seed 1..100 --set control.depth.kp=20,40 --out kp.csv
             lindy sweep --vehicle pioneer,minerva --link tether,severe --seed 1..20 --out v.csv

    Parameters
    ----------
    out
        the table, .csv; the finished dives are beside it
    seed
        of everything random in simulator and link: 7, 1,2,5 or 1..100
    set_
        key.path=value,value into the vehicle file; repeatable
    vehicle
        names in deploy/vehicles, or paths of TOML files
    link
        names in deploy/links, or paths of TOML files
    pilot
        script:FILE (a CSV stick log)
    stack
        which services: a name in deploy/stacks, or the path of a TOML file
    seconds
        end each dive this long after arming
    workers
        processes; default: one for each core
    picture
        a new PNG: the main figures of each combination of the axes
    """
    wanted = Wanted(
        axes=axes(vehicle, link, pilot, set_, seed),
        out=out, stack=stack, seconds=seconds, workers=workers,
    )  # fmt: skip
    if out.suffix != ".csv":
        raise LindyError(f"--out {out}: expected a name that ends in .csv")
    if picture is not None:
        require_picture(picture, "--picture")
    if workers is not None and workers < 1:
        raise LindyError(f"--workers is {workers}, expected 1 or more")
    about = _checked(wanted)
    with closing(FinishedDives(out, about)) as finished:
        require_unedited(out, [*finished.rows.values()], list(wanted.axes.settings))
        try:
            stopped = _fly(wanted, finished)
        except LindyError as error:
            if finished.rows:
                with suppress(LindyError):
                    _write_table(wanted, finished)
            raise LindyError(f"{error}; {_kept(finished, wanted)}") from error
        left = len(finished.rows) < wanted.axes.count
        interrupted = EndedByUserError(f"interrupted; {_kept(finished, wanted)}")
        if stopped and not finished.rows:
            raise interrupted
        rows = _write_table(wanted, finished)
    print(f"written {out} ({_counted(len(rows), 'row')})", flush=True)
    if picture is not None and rows and not left:
        picture.parent.mkdir(parents=True, exist_ok=True)
        write_fresh(picture, drawn(rows, wanted.axes.varied), "--picture")
        print(f"written {picture}", flush=True)
    if stopped and left:
        raise interrupted
    failed = [row for row in rows if row["end"] != CLEAN]
    if failed:
        raise LindyError(
            f"{len(failed)} of {_counted(len(rows), 'dive')} ended with an error; the first, dive "
            f"{failed[0]['dive']}: {failed[0]['end']}"
        )
    return 0


def _checked(wanted: Wanted) -> About:
    """What the sweep is, once every combination has been checked.

    Raises:
        LindyError: the first mistake found.
    """
    services = without_files(Registry.read(wanted.stack))
    services.require_whole()
    files = {str(services.file): _checksum(services.file)}
    for vehicle, link, pilot, settings in wanted.axes.combinations():
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
        **{f"--{n}": getattr(wanted.axes, n) for n in ("vehicle", "link", "pilot", "seed")},
        "--set": wanted.axes.settings,
        "files": files,
    }


def _checksum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def _fly(wanted: Wanted, finished: FinishedDives) -> bool:
    """Fly what is missing. Was it interrupted?"""
    jobs = [
        Job(dive, wanted.stack, wanted.seconds)
        for dive in wanted.axes.dives()
        if dive.number not in finished.rows
    ]
    workers = min(wanted.workers or system.cores(), max(1, len(jobs)))
    count, before = wanted.axes.count, len(finished.rows)
    there = f", {before} of them done before" if before else ""
    flown, used = _counted(count, "dive"), _counted(workers, "core")
    print(f"{flown}{there}, on {used} → {wanted.out}", flush=True)
    with StopSignals() as stop, _progress(count, before) as advance:
        for result in on_all_cores(fly_one, jobs, workers, lambda: stop.asked):
            if result is not None and (row := result[1]) is not None:
                finished.add(row)
            advance(len(finished.rows))
        return stop.asked


@contextmanager
def _progress(total: int, before: int) -> Generator[Callable[[int], None]]:
    """A progress bar on a terminal, otherwise a line every `LINE_S`."""
    console = Console()
    if console.is_terminal and not console.is_dumb_terminal:  # which cannot draw one
        columns = TextColumn("diving"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        with Progress(*columns, console=console, transient=True) as bar:
            task = bar.add_task("diving", total=total, completed=before)
            yield lambda done: bar.update(task, completed=done)
        return
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

    yield advance


def _write_table(wanted: Wanted, finished: FinishedDives) -> list[Row]:
    """Returns its rows, in the order of the dives."""
    rows = [finished.rows[number] for number in sorted(finished.rows)]
    finished.replace_table(encoded(rows, list(wanted.axes.settings)))
    return rows


def _kept(finished: FinishedDives, wanted: Wanted) -> str:
    verb = "is" if wanted.axes.count == 1 else "are"
    return (
        f"{len(finished.rows)} of {_counted(wanted.axes.count, 'dive')} {verb} kept in "
        f"{rows_file(wanted.out)}, and the same command goes on with the rest"
    )


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"
