"""A disk that fills up is noticed while there is still room to finish files, and reported."""

import errno
import os
import shutil
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
