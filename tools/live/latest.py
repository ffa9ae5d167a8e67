"""The link `dives/latest`."""

import os
from pathlib import Path

from services.runtime.config.disk import reason
from services.runtime.os import system

DIVES = Path("dives")  # for dives without --out
LATEST = "latest"  # in it: a link to the newest of them


def point(folder: Path) -> None:
    """Make `dives/latest` a link to this dive, if it is in `dives/`. Anything else with that name
    is left as it is, and that is printed."""
    home = DIVES.resolve()
    if folder.parent != home or folder.name == LATEST:
        return
    pointer = home / LATEST
    if os.path.lexists(pointer) and not _is_ours(pointer):
        print(f"{pointer} is not a link to a dive; it stays as it is", flush=True)
        return
    try:
        system.point(pointer, folder.name)
    except OSError as error:
        print(f"cannot make {pointer} point to this dive: {reason(error)}", flush=True)


def _is_ours(pointer: Path) -> bool:
    """A link to a folder beside it, as `point` makes it."""
    return pointer.is_symlink() and len(pointer.readlink().parts) == 1
