"""A disk that fills up is noticed while there is still room to finish files, and reported; new
folders beside what is there."""

import errno
import os
import shutil
from collections.abc import Callable
from itertools import count
from pathlib import Path

FULL = {errno.ENOSPC, errno.EDQUOT}


def require_room(folder: Path, size: int) -> None:
    """
    Args:
        size: [bytes] that must be free in the folder.

    Raises:
        OSError: there is less, or the free space cannot be read.
    """
    usage = shutil.disk_usage(folder)
    if usage.free < size and usage.total > 0:  # some network disks report 0
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))


def reason(error: OSError) -> str:
    """Why, as the end of a sentence."""
    if error.errno in FULL:
        return "the disk is full"
    return (error.strerror or str(error)).lower()


def fresh_folder(wanted: Path, taken: Callable[[Path], bool] = Path.exists) -> Path:
    """The folder `wanted`, made if it is not there; where it is taken, a new one beside it:
    `wanted-2`, `wanted-3` … Two programs may want one at the same time: only one can make it.

    Raises:
        OSError: it cannot be made, or is a file.
    """
    for number in count(1):
        folder = wanted if number == 1 else wanted.with_name(f"{wanted.name}-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            if number == 1 and not folder.is_dir():
                raise
            if number > 1 or taken(folder):
                continue
        return folder
    raise AssertionError("numbers do not end")
