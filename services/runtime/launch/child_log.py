"""What the processes of one task print, one after the other, from their pipes into a file."""

import os
import threading
import time
from pathlib import Path
from queue import SimpleQueue
from typing import IO

from services.runtime.config.disk import reason

TAIL = 4096  # [bytes] of what was printed in which the last line is looked for
WHOLE_S = 0.2  # [s] in which what an ended process has printed is read; a disk may hang
CHUNK = 65_536  # [bytes]
NO_MEMORY_S = 0.1  # [s] until it is tried again


class ChildLog:
    """On a thread of its own, because a disk may hang, as one of another computer: whoever prints
    goes on meanwhile, until the pipe is full. The thread begins with the first process and serves
    them all, because later there may be no room for another one.

    The file is appended to, and for its owner alone: with the address in the cockpit's log whoever
    reads it could fly.
    """

    def __init__(self, path: Path) -> None:
        self.unlogged = ""  # why what was printed last is not kept; empty: it is
        self._path, self._file = path, -1
        self._pipes = SimpleQueue[IO[bytes] | None]()
        self._thread: threading.Thread | None = None
        self._whole = threading.Event()  # everything of the newest one has been read
        self._whole.set()
        self._tail = b""

    def follow(self, printed: IO[bytes]) -> None:
        """What comes from there, to its end."""
        self.unlogged, self._tail = "", b""
        if self._thread is None:
            thread = threading.Thread(target=self._copy_all, daemon=True)
            try:
                thread.start()
            except RuntimeError:
                self.unlogged = "this computer has no room for another thread"
                printed.close()
                return
            self._thread = thread
        self._whole.clear()
        self._pipes.put(printed)

    def last_line(self) -> str:
        """Of what the newest process has printed, of one that has ended of all of it; empty if
        nothing."""
        self._whole.wait(WHOLE_S)
        lines = self._tail.decode(errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "")

    def close(self) -> None:
        """No process is left."""
        self._pipes.put(None)

    def _copy_all(self) -> None:
        while (printed := self._pipes.get()) is not None:
            with printed:
                self._keep(b"")  # the log is there, also of who prints nothing
                while chunk := _read(printed):
                    self._tail = (self._tail + chunk)[-TAIL:]
                    self._keep(chunk)
            if self._file >= 0:
                os.close(self._file)
                self._file = -1
            if self._pipes.empty():
                self._whole.set()

    def _keep(self, chunk: bytes) -> None:
        # Where it cannot be written the pipe is emptied all the same: a service matters more than
        # what it prints.
        try:
            if self._file < 0:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._file = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
            while chunk:  # a disk that gets full takes a part of it, and then nothing
                chunk = chunk[os.write(self._file, chunk) :]
        except OSError as error:
            self.unlogged = f"cannot write {self._path}: {reason(error)}"
        except MemoryError:
            self.unlogged = f"cannot write {self._path}: there is no memory"


def _read(printed: IO[bytes]) -> bytes:
    """What is there; empty at the end."""
    while True:
        try:
            return os.read(printed.fileno(), CHUNK)
        except MemoryError:
            time.sleep(NO_MEMORY_S)  # there may be some later
        except OSError:
            return b""
