"""Checkpoints: what a service restores after a crash, so that it can continue the dive.

For example the air pressure measured at the surface, or the time at which a stick log began: small
data that cannot be measured again under water. One Struct per service, written whole.
"""

import os
import threading
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from services.runtime.config.disk import reason
from services.runtime.os import system

CLOSE_S = 1.0  # [s] at most, for the last checkpoint to reach a slow disk


class CheckpointStore(Protocol):
    def restore_checkpoint(self) -> bytes | None:
        """The newest checkpoint of an earlier run, or None.

        Raises:
            OSError: there is one that cannot be read.
        """
        ...

    def save_checkpoint(self, data: bytes) -> None:
        """Replace the checkpoint. Never waits for a disk."""
        ...

    def failures(self) -> int:
        """How many checkpoints could not be written since this was last asked."""
        ...


class VolatileCheckpoint:
    """For the virtual host: survives a restart of the node, not of the program."""

    def __init__(self) -> None:
        self._data: bytes | None = None

    def restore_checkpoint(self) -> bytes | None:
        return self._data

    def save_checkpoint(self, data: bytes) -> None:
        self._data = data

    def failures(self) -> int:
        return 0


class CheckpointFile:
    """For the process host: one small file, written by its own thread, because a disk may be slow.
    While one checkpoint is being written, only the newest of the following ones is kept."""

    def __init__(self, path: Path) -> None:
        self.why = ""  # the last one could not be written; empty: it was
        self._path = path
        self._newest: bytes | None = None  # waits to be written
        self._failed = 0
        self._closing = False
        self._changed = threading.Condition()
        self._writer = threading.Thread(target=self._write_all, daemon=True)
        self._writer.start()

    def restore_checkpoint(self) -> bytes | None:
        try:
            return self._path.read_bytes()
        except FileNotFoundError:
            return None

    def save_checkpoint(self, data: bytes) -> None:
        with self._changed:
            self._newest = data
            self._changed.notify()

    def failures(self) -> int:
        with self._changed:
            failed, self._failed = self._failed, 0
            return failed

    def close(self) -> None:
        """Write what still waits, if the disk is fast enough, and end the thread."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._writer.join(CLOSE_S)

    def _write_all(self) -> None:
        while (data := self._next()) is not None:
            try:
                write_safely(self._path, data)
                self.why = ""
            except (OSError, MemoryError) as error:  # later there may be room again
                with self._changed:
                    self._failed += 1
                    self.why = reason(error) if isinstance(error, OSError) else "no memory"

    def _next(self) -> bytes | None:
        """Wait for a checkpoint to write; None: there is none and the file is being closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest is not None or self._closing)
            data, self._newest = self._newest, None
            return data


def write_safely(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Replace a file atomically: after a power cut it is either the old or the new one.

    Args:
        mode: bits of a new file, from its first byte on, but for those of the user's umask.

    Raises:
        OSError: the disk failed; the file is unchanged, and nothing is left beside it.
    """
    fresh = path.with_name(f".{path.name}.new")  # nobody else's, in a folder with files of others
    try:
        with open(fresh, "wb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
    except OSError:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)
        raise
    system.sync_folder(path.parent)  # the replacement itself
