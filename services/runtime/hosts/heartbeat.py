"""A sign of life of a process for the supervisor of its machine: when its loop last went round.

It stands in a small file that the process maps into memory, not on the bus, because the bus may be
what does not work. Writing costs nothing and waits for nobody.
"""

import mmap
import struct
from pathlib import Path

from services.runtime.config.disk import reason

STAMP = struct.Struct("<q")  # [ns] of the monotonic clock, which all processes of a machine share


class Heartbeat:
    """The writing end. A file that cannot be made is no reason not to run: then nobody watches.

    Attributes:
        unwatched: why, although somebody wanted to watch; empty: all is well.
    """

    def __init__(self, path: Path | None) -> None:
        self._map: mmap.mmap | None = None
        self.unwatched = ""
        if path is None:
            return
        try:
            path.write_bytes(bytes(STAMP.size))
            with path.open("r+b") as file:
                self._map = mmap.mmap(file.fileno(), STAMP.size)
        except OSError as error:
            self.unwatched = f"nobody would notice if it hung: cannot write {path}: {reason(error)}"

    def beat(self, now: int) -> None:
        """The loop goes round at `now` [ns]."""
        if self._map is not None:
            STAMP.pack_into(self._map, 0, now)


def last_beat(path: Path) -> int | None:
    """[ns] When the process of this file last beat; None: never, or nobody can tell."""
    try:
        return STAMP.unpack(path.read_bytes())[0] or None
    except (OSError, struct.error):
        return None
