"""Writes the file `dive.rrd`. rerun's encoded output is written here as bytes, because rerun's own
file writer stops at a full disk without reporting it, and then hangs at the end of the process.

Each read from rerun gives a whole stream: a header, messages, and an index that adds half to its
size. The file gets the first header and all messages; viewers and readers do not need the index.
Layout of a stream, from rerun's re_log_encoding: 12 bytes of header; messages, each with its kind
and its length as unsigned 64 bit; the last is of kind 0 and contains the index.
"""

import struct
from collections.abc import Callable
from pathlib import Path

from messages import events
from messages.events import Event, Level
from services.runtime.config.disk import reason, require_room

Tell = Callable[[Event], None]
Log = Callable[[Level, str], None]
MAGIC, HEADER_BYTES, INDEX = b"RRF2", 12, 0
MESSAGE = struct.Struct("<QQ")  # kind, length
RESERVE = 1_000_000  # [bytes] left free for the recorder, whose file matters more


class RrdFile:
    """Contains whole batches only. When the disk fails, batches are dropped and counted, and one
    warning is logged."""

    def __init__(self, path: Path, tell: Tell, log: Log) -> None:
        """
        Raises:
            OSError: there is such a file already, or it cannot be made.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._path = path
        self._stream = path.open("xb", buffering=0)
        self._tell = tell
        self._log = log
        self._failing = False

    def begin(self, data: bytes) -> None:
        """Write the header and the first messages.

        Raises:
            OSError: they cannot be written; there is no file then.
            ValueError: as `index_at`.
        """
        try:
            self._write(data[: index_at(data)])
        except (OSError, ValueError):
            self._stream.close()
            self._path.unlink()
            raise

    def append(self, data: bytes) -> None:
        """Write a batch, or drop and count it."""
        try:
            self._write(data[HEADER_BYTES : index_at(data)])
        except OSError as error:
            self._tell(events.DISK_ERROR(self._path.name))
            if not self._failing:
                self._log("warning", f"cannot write {self._path}: {reason(error)}; it has a gap")
            self._failing = True
            return
        if self._failing:
            self._log("info", f"{self._path} continues")
        self._failing = False

    def close(self) -> None:
        self._stream.close()

    def _write(self, data: bytes) -> None:
        require_room(self._path.parent, RESERVE + len(data))
        begin = self._stream.tell()
        try:
            rest = memoryview(data)
            while rest:
                rest = rest[self._stream.write(rest) :]
        except OSError:
            self._stream.seek(begin)
            self._stream.truncate()  # half a batch would make the rest unreadable
            raise


def index_at(stream: bytes) -> int:
    """Where the index begins, which is where the messages end.

    Raises:
        ValueError: this is not a whole stream of the known layout.
    """
    at = HEADER_BYTES
    while stream.startswith(MAGIC) and at + MESSAGE.size <= len(stream):
        kind, length = MESSAGE.unpack_from(stream, at)
        if kind == INDEX:
            return at
        at += MESSAGE.size + length
    raise ValueError("this version of rerun encodes recordings in an unknown way")
