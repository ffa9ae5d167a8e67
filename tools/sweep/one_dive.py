"""One dive of a sweep, in a worker: it ends with a row, whatever happens in it, unless the disk has
no room for what it leaves: then it is flown again."""

import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec

from messages import events
from services.recorder.io.mcap_session import RESERVE, CannotRecordError
from services.runtime.config.disk import fresh_folder, reason, require_room
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.analysis.dive import read_dive
from tools.checks import pilot_of, read_besides
from tools.fresh import write_fresh
from tools.live.dive_folder import holds_dive
from tools.live.dive_timeline import DiveTimeline
from tools.live.outcome import Outcome
from tools.live.virtual_dive import INTERRUPTED, MemoryRecorder, fly, without_files
from tools.recordings.recording import log_hash, open_recording
from tools.report.report import encode
from tools.sweep.all_cores import asked_to_stop
from tools.sweep.axes import PlannedDive
from tools.sweep.rows import CLEAN, Flown, Row, row_of


class Job(NamedTuple):
    """What a worker needs to fly one dive."""

    dive: PlannedDive
    stack: str  # a name or a file, as --stack
    seconds: float | None  # [s] after arming
    keep: str  # folder for the folders of recorded dives; empty: nothing is recorded


def fly_one(job: Job) -> Row | None:
    """The row of a dive; None: it was interrupted.

    Raises:
        CannotRecordError: it was to be recorded, and the disk did not take all of it.
    """
    if asked_to_stop():
        return None
    began = time.perf_counter()
    flown, end, folder = None, CLEAN, ""
    try:
        with _folder(job) as out:
            folder = str(out) if job.keep else ""
            flown = _flown(job, out)
        end = flown.report.exit
    except CannotRecordError:
        raise
    except LindyError as error:
        end = str(error)
    except Exception as error:  # a mistake in one dive does not end the others
        end = f"an error in this dive: {type(error).__name__}: {error}"
    if end == INTERRUPTED:
        return None
    return row_of(job.dive, flown, " ".join(end.split()), time.perf_counter() - began, folder)


@contextmanager
def _folder(job: Job) -> Generator[Path]:
    """Where the dive is flown: one that goes again, or that of its recording, or, where that holds
    a dive, such as an interrupted one, a new one beside it.

    Raises:
        CannotRecordError: it cannot be made.
    """
    if not job.keep:
        with TemporaryDirectory(prefix="lindy-") as temporary:
            yield Path(temporary)
        return
    wanted = Path(job.keep) / f"dive-{job.dive.number:06d}"
    try:
        folder = fresh_folder(wanted, holds_dive)
    except OSError as error:
        raise CannotRecordError(f"cannot make the folder {wanted}: {reason(error)}") from None
    try:
        yield folder
    except CannotRecordError:
        if folder != wanted:
            with suppress(OSError):  # it is not empty
                folder.rmdir()
        raise


def _flown(job: Job, folder: Path) -> Flown:
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
        out=str(folder),
    )
    besides = read_besides(stack, pilot.incidents, pilot.courses)
    stack = msgspec.structs.replace(stack, read_besides=besides)
    outcome, memory = Outcome(stack), None if job.keep else MemoryRecorder()
    timeline = DiveTimeline(pilot.script_s, job.seconds)
    fly(stack, services, timeline, outcome, stop=asked_to_stop, memory=memory)
    if memory is None:
        return _recorded(folder, outcome)
    dive = memory.dive()
    return Flown(outcome.report_in_memory(dive, memory.log_hash()), dive.max_depth_m)


def _recorded(folder: Path, outcome: Outcome) -> Flown:
    """The figures of a dive that was recorded, and `report.json` in its folder.

    Raises:
        CannotRecordError: the recording is not whole, or there is no room for the report.
        LindyError: nothing was recorded, for another reason.
    """
    outcome.require_recording()
    dive, hashed = read_dive(open_recording(folder)), log_hash(folder)
    if outcome.exit != INTERRUPTED and (hashed is None or events.DISK_ERROR.name in dive.losses):
        why = "the disk was full or failed"
        try:
            require_room(folder, RESERVE)
        except OSError as error:
            why = reason(error)
        raise CannotRecordError(f"the recording in {folder} was cut short: {why}")
    report = outcome.report_in_memory(dive, hashed or "")
    try:
        write_fresh(folder / "report.json", encode(report))
    except LindyError as error:
        raise CannotRecordError(str(error)) from None
    return Flown(report, dive.max_depth_m)
