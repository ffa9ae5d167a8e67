"""The folder of a dive: always one without an earlier dive in it; and the link `dives/latest`."""

import atexit
import contextlib
import os
import re
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from services.recorder.io.mcap_session import RESERVE
from services.recorder.io.parts import part_path
from services.runtime.config.disk import fresh_folder, reason, require_room
from services.runtime.config.errors import LindyError
from services.runtime.config.running import running_in
from services.runtime.os import system

DIVES = Path("dives")  # for dives without --out
LATEST = "latest"  # in it: a link to the newest of them
LOGS = "logs"
WRITTEN = re.compile(r"dive(\.part\d+)?\.(mcap|rrd)|merging\.mcap|report\.json|run\.json")


def out_folder(out: Path | None) -> Path:
    """A writable folder that holds no dive: `out`, or, where that holds one already, a new folder
    beside it, which is printed. If it stays empty, it is removed at the end of the program.

    Raises:
        LindyError: it cannot be made or written to, or a dive is going on in it.
    """
    wanted = out or DIVES / f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%SZ}"
    try:
        wanted = wanted.resolve()
        missing = [path for path in (wanted, *wanted.parents) if not path.exists()]
        if out is not None and (running := running_in(wanted)) is not None:
            raise LindyError(f"a dive (process {running.supervisor}) is going on in --out {wanted}")
        # Two dives may begin in the same second: a folder named by the time is always a new one.
        folder = fresh_folder(wanted, Path.exists if out is None else holds_dive)
        with tempfile.TemporaryFile(dir=folder):
            pass  # it can be written to
    except RuntimeError:  # Python's word for it until 3.12
        raise LindyError(f"cannot write into --out {wanted}: links that lead in a circle") from None
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


def holds_dive(folder: Path) -> bool:
    """Is there a file in it with a name that a dive writes? Other files do not matter."""
    names = {path.name for path in folder.iterdir()}
    logs = folder / LOGS
    if LOGS in names and (not logs.is_dir() or any(logs.iterdir())):
        return True
    return any(WRITTEN.fullmatch(name) for name in names)


def dive_files(folder: Path, kind: str) -> list[Path]:
    """The files of one kind (mcap or rrd) that a dive has written there."""
    return sorted(path for path in folder.glob(f"*.{kind}") if WRITTEN.fullmatch(path.name))


def point_latest(folder: Path) -> None:
    """The first files of a dive are in its folder: make `dives/latest` a link to it, if it is in
    `dives/`. Anything else with that name is left as it is, and that is printed."""
    home = DIVES.resolve()
    pointer = home / LATEST
    if folder.parent != home or folder == pointer:
        return
    ours = pointer.is_symlink() and len(pointer.readlink().parts) == 1
    if os.path.lexists(pointer) and not ours:
        print(f"{pointer} is not a link to a dive; it stays as it is", flush=True)
        return
    try:
        fresh = pointer.with_name(f".{LATEST}-{os.getpid()}")
        fresh.symlink_to(folder.name, target_is_directory=True)
        if system.WINDOWS:  # it does not put one link to a folder in the place of another
            pointer.unlink(missing_ok=True)
        fresh.replace(pointer)
    except OSError as error:
        print(f"cannot make {pointer} point to this dive: {reason(error)}", flush=True)


def _remove_empty(folders: list[Path]) -> None:
    """Innermost first."""
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.rmdir()
