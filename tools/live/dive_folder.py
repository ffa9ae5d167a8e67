"""The folder of a dive: always one without an earlier dive in it; and the link `dives/latest`."""

import atexit
import contextlib
import fcntl
import os
import re
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from services.recorder.io.mcap_session import RESERVE
from services.recorder.io.parts import part_path
from services.runtime.config.disk import reason, require_room
from services.runtime.config.errors import LindyError
from tools.checks import running_in
from tools.fresh import fresh_folder

DIVES = Path("dives")  # for dives without --out
LATEST = "latest"  # in it: a link to the newest of them
LOGS = "logs"
CLAIMS: dict[Path, int] = {}  # open folders that this program has locked
WRITTEN = re.compile(r"dive(\.part\d+)?\.(mcap|rrd)|merging\.mcap|report\.json|run\.json")


def out_folder(out: Path | None) -> Path:
    """A writable folder that holds no dive: `out`, or, where that holds one already, a new folder
    beside it, which is printed. If it stays empty, it is removed at the end of the program.

    Raises:
        LindyError: it cannot be made or written to, or a dive is going on in it.
    """
    wanted = (out or DIVES / f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%SZ}").resolve()
    missing = [path for path in (wanted, *wanted.parents) if not path.exists()]
    try:
        if out is not None and (pid := running_in(wanted)) is not None:
            raise LindyError(f"a dive (process {pid}) is going on in --out {wanted}")
        # Two dives may begin in the same second: a folder named by the time is always a new one.
        folder = fresh_folder(wanted, Path.exists if out is None else holds_dive)
        if not _claimed(folder):  # another dive has just begun in it and not written anything yet
            folder = fresh_folder(wanted, Path.exists)
            _claimed(folder)
        with tempfile.TemporaryFile(dir=folder):
            pass  # it can be written to
    except OSError as error:
        raise LindyError(f"cannot write into --out {wanted}: {reason(error)}") from None
    if folder != wanted:
        missing = [folder]
        if out is not None:
            print(f"{wanted} holds a dive already; this one goes to {folder}", flush=True)
    atexit.register(_remove_empty, missing)
    return folder


def require_room_for_recording(folder: Path) -> None:
    """Call it before anything is started: on a full disk a service has no room to say why it ended.

    Raises:
        LindyError: the recorder could not begin in this folder.
    """
    try:
        require_room(folder, RESERVE)
    except OSError as error:
        path = part_path(folder, 1)
        raise LindyError(f"cannot write the recording {path}: {reason(error)}") from None


def _claimed(folder: Path) -> bool:
    """Lock a folder until the dive's first files are in it. False: another program has it. A file
    system without locks counts as locked."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        return False
    except OSError:
        os.close(handle)
    else:
        CLAIMS[folder] = handle  # closing it ends the lock
    return True


def holds_dive(folder: Path) -> bool:
    """Is there a file in it with a name that a dive writes? Other files do not matter."""
    names = {path.name for path in folder.iterdir()}
    if LOGS in names and not _is_empty(folder / LOGS):
        return True
    return any(WRITTEN.fullmatch(name) for name in names)


def dive_files(folder: Path, kind: str) -> list[Path]:
    """The files of one kind (mcap or rrd) that a dive has written there."""
    return sorted(path for path in folder.glob(f"*.{kind}") if WRITTEN.fullmatch(path.name))


def point_latest(folder: Path) -> None:
    """Make `dives/latest` a link to this dive, if it is in `dives/`. Anything else with that name
    is left as it is, and that is printed."""
    if (handle := CLAIMS.pop(folder, None)) is not None:
        os.close(handle)  # the first files are there, and say by themselves whose folder it is
    home = DIVES.resolve()
    if folder.parent != home or folder.name == LATEST:
        return
    pointer, fresh = home / LATEST, home / f".{LATEST}-{os.getpid()}"
    if os.path.lexists(pointer) and not _is_ours(pointer):
        print(f"{pointer} is not a link to a dive; it stays as it is", flush=True)
        return
    try:
        fresh.symlink_to(folder.name, target_is_directory=True)
        fresh.replace(pointer)  # at once: it always points somewhere
    except OSError as error:
        print(f"cannot make {pointer} point to this dive: {reason(error)}", flush=True)


def _is_ours(pointer: Path) -> bool:
    """A link to a folder beside it, as `point_latest` makes it."""
    return pointer.is_symlink() and len(pointer.readlink().parts) == 1


def _is_empty(folder: Path) -> bool:
    return folder.is_dir() and not any(folder.iterdir())


def _remove_empty(folders: list[Path]) -> None:
    """Innermost first."""
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.rmdir()
