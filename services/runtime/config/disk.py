"""A disk that fills up is noticed while there is still room to finish files, and reported."""

import errno
import os
import shutil
from pathlib import Path

from services.runtime.os import system

FULL = {errno.ENOSPC, errno.EDQUOT}
FILES = 64  # that a dive makes at most: logs, checkpoints, recordings, its report


def require_room(folder: Path, size: int, files: int = 0) -> None:
    """
    Args:
        size: [bytes] that must be free in the folder.
        files: new ones that the disk must take; a disk may have no inodes left for them.

    Raises:
        OSError: there is less, or the free space cannot be read.
    """
    usage = shutil.disk_usage(folder)
    too_full = usage.free < size and usage.total > 0  # some network disks report 0
    if too_full or (files and _files_left(folder) < files):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))


def reason(error: OSError) -> str:
    """Why, as the end of a sentence."""
    if error.errno in FULL:
        return "the disk is full" if _takes_files(error) else "the disk takes no more files"
    return (error.strerror or str(error)).lower()


def _takes_files(error: OSError) -> bool:
    """False where a disk that has room is full for the number of its files."""
    if not isinstance(error.filename, str):
        return True
    path = Path(error.filename)
    try:
        folder = path if path.is_dir() else path.parent
        return shutil.disk_usage(folder).free == 0 or _files_left(folder) >= FILES
    except OSError:
        return True


def _files_left(folder: Path) -> int:
    """New files that a disk takes; as many as any dive needs where it has no limit."""
    left = system.files_left(folder)
    return FILES if left is None else left
