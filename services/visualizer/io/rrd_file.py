"""The file `dive.rrd` being written. What rerun has encoded comes here as bytes, because rerun's
own file writer ends at a full disk without a word to us, and then hangs at the end of the process.

Every time we ask rerun for bytes, it gives a whole stream: a header, messages, and an index that is
half as large again. The file gets the first header and all messages; viewers and readers do without
the index. Layout of a stream, from rerun's re_log_encoding: 12 bytes of header; messages, each with
its kind and its length as unsigned 64 bit; the last is of kind 0 and holds the index.
"""

import struct
from pathlib import Path

from services.runtime.config.disk import reason, require_room
from services.visualizer.io.live_viewer import Count, Log

MAGIC, HEADER_BYTES, INDEX = b"RRF2", 12, 0
MESSAGE = struct.Struct("<QQ")  # kind, length
RESERVE = 1_000_000  # [bytes] left free: the recording is worth more than its picture


class RrdFile:
    """Ends up with whole batches only. After its beginning a failing disk costs batches, which are
    counted, and is said once."""

    def __init__(self, path: Path, count: Count, log: Log) -> None:
        """
        Raises:
            OSError: there is such a file already, or it cannot be made.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._path = path
        self._stream = path.open("xb", buffering=0)
        self._count = count
        self._log = log
        self._failing = False

    def begin(self, data: bytes) -> None:
        """Without these nobody can read the rest.

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
        """Write a batch, or leave it out."""
        try:
            self._write(data[HEADER_BYTES : index_at(data)])
        except OSError as error:
            self._count(f"disk_error:{self._path.name}")
            if not self._failing:
                self._log("warning", f"cannot write {self._path}: {reason(error)}; it has a gap")
            self._failing = True
            return
        if self._failing:
            self._log("info", f"{self._path} goes on")
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
            self._stream.truncate()  # half a batch would make what follows unreadable
            raise


def index_at(stream: bytes) -> int:
    """Where the index begins, which is where the messages end.

    Raises:
        ValueError: this is not a whole stream as we know it.
    """
    at = HEADER_BYTES
    while stream.startswith(MAGIC) and at + MESSAGE.size <= len(stream):
        kind, length = MESSAGE.unpack_from(stream, at)
        if kind == INDEX:
            return at
        at += MESSAGE.size + length
    raise ValueError("rerun encodes recordings in a way that is not known here")
