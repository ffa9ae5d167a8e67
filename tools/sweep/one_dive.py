"""One dive of a sweep, in a worker: it ends with a row, whatever happens in it, unless the disk has
no room for what it leaves."""

import time
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec

from services.recorder.io.mcap_session import CannotRecordError
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.checks import pilot_of, read_besides
from tools.live.dive_timeline import DiveTimeline
from tools.live.outcome import Outcome
from tools.live.virtual_dive import INTERRUPTED, MemoryRecorder, fly, without_files
from tools.sweep.all_cores import asked_to_stop
from tools.sweep.axes import PlannedDive
from tools.sweep.recorded import own_folder, read_recorded
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
        with TemporaryDirectory(prefix="lindy-") as temporary, _kept(job) as kept:
            folder = str(kept or "")
            flown = _flown(job, folder or temporary)
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


def killed_row(job: Job) -> Row | None:
    """The row of a dive whose worker was killed each time."""
    why = "its process was killed, and again when it was flown alone; perhaps the memory was full"
    return row_of(job.dive, None, why, 0.0, "")


def _kept(job: Job) -> AbstractContextManager[Path | None]:
    """The folder that stays, if one does."""
    if not job.keep:
        return nullcontext()
    return own_folder(Path(job.keep) / f"dive-{job.dive.number:06d}")


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
    outcome, memory = Outcome(stack), None if job.keep else MemoryRecorder()
    timeline = DiveTimeline(pilot.script_s, job.seconds)
    fly(stack, services, timeline, outcome, stop=asked_to_stop, memory=memory)
    if memory is None:
        return read_recorded(stack, outcome)
    dive = memory.dive()
    return Flown(outcome.report_in_memory(dive, memory.log_hash()), dive.max_depth_m)
