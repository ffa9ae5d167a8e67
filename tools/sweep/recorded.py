"""The folder of a dive of a sweep that is recorded: made before it, read and completed after it.

A recording that the disk did not take whole is an error, so that the dive is flown again.
"""

from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from messages import events
from services.recorder.io.mcap_session import RESERVE, CannotRecordError
from services.runtime.config.disk import reason, require_room
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.fresh import fresh_folder, write_fresh
from tools.live.dive_folder import holds_dive
from tools.live.outcome import Outcome
from tools.live.virtual_dive import INTERRUPTED
from tools.recordings.recording import log_hash, open_recording
from tools.report import encode, read_dive
from tools.sweep.rows import Flown


@contextmanager
def own_folder(wanted: Path) -> Generator[Path]:
    """The folder, or, where that holds a dive, a new one beside it: of an interrupted dive there
    may be one already. It is removed where the dive left nothing in it.

    Raises:
        CannotRecordError: it cannot be made.
    """
    new = not wanted.exists()
    try:
        folder = fresh_folder(wanted, holds_dive)
    except OSError as error:
        raise CannotRecordError(f"cannot make the folder {wanted}: {reason(error)}") from None
    try:
        yield folder
    except CannotRecordError:
        if new or folder != wanted:
            with suppress(OSError):  # it is not empty
                folder.rmdir()
        raise


def read_recorded(stack: Stack, outcome: Outcome) -> Flown:
    """After the dive: its figures, and `report.json` in its folder.

    Raises:
        CannotRecordError: the recording is not whole, or there is no room for the report.
        LindyError: nothing was recorded, for another reason.
    """
    outcome.require_recording()
    folder = stack.out_dir
    dive, hashed = read_dive(open_recording(folder)), log_hash(folder)
    if outcome.exit != INTERRUPTED and (hashed is None or events.DISK_ERROR.name in dive.losses):
        raise CannotRecordError(f"the recording in {folder} was cut short: {_why(folder)}")
    report = outcome.report_in_memory(dive, hashed or "")
    try:
        write_fresh(folder / "report.json", encode(report))
    except LindyError as error:
        raise CannotRecordError(str(error)) from None
    return Flown(report, dive.max_depth_m)


def _why(folder: Path) -> str:
    try:
        require_room(folder, RESERVE)
    except OSError as error:
        return reason(error)
    return "the disk was full or failed"
