"""One dive of a sweep, in a worker: it ends with a row, whatever happens in it."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.checks import pilot_of
from tools.fresh import fresh_folder, write_fresh
from tools.live.dive_folder import holds_dive
from tools.live.dive_timeline import DiveTimeline
from tools.live.memory_recorder import MemoryRecorder
from tools.live.outcome import Outcome
from tools.live.virtual_dive import INTERRUPTED, fly, without_files
from tools.recordings.recording import log_hash, open_recording
from tools.report import encode, read_dive
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
    """The row of a dive; None: it was interrupted."""
    began = time.perf_counter()
    flown, end, folder = None, CLEAN, ""
    try:
        with TemporaryDirectory(prefix="lindy-") as temporary:
            folder = str(_folder(job)) if job.keep else ""
            flown = _flown(job, folder or temporary)
        end = flown.report.exit
    except LindyError as error:
        end = str(error)
    except Exception as error:  # a mistake in one dive does not end the others
        end = f"an error in this dive: {type(error).__name__}: {error}"
    if end == INTERRUPTED:
        return None
    return row_of(job.dive, flown, " ".join(end.split()), time.perf_counter() - began, folder)


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
        virtual=True,
        out=folder,
    )
    outcome, memory = Outcome(stack), None if job.keep else MemoryRecorder()
    timeline = DiveTimeline(pilot.script_s, job.seconds)
    fly(stack, services, timeline, outcome, stop=asked_to_stop, memory=memory)
    if memory is not None:
        dive = memory.dive()
        return Flown(outcome.report_in_memory(dive, memory.log_hash()), dive.max_depth_m)
    dive = read_dive(open_recording(stack.out_dir))
    report = outcome.report_in_memory(dive, log_hash(stack.out_dir) or "")
    write_fresh(stack.out_dir / "report.json", encode(report))
    return Flown(report, dive.max_depth_m)


def _folder(job: Job) -> Path:
    """A new one: of an interrupted dive there may be one already."""
    return fresh_folder(Path(job.keep) / f"dive-{job.dive.number:06d}", holds_dive)
