"""One child process: start, watch, end; and the file with what it prints."""

import contextlib
import os
import subprocess
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Protocol

from services.runtime.config.disk import reason
from services.runtime.os import system

KILL_S = 0.5  # [s] in which a killed process is normally gone
IDLE = "STt"  # states of a thread: asleep, stopped, stopped by a debugger
TAIL = 4096  # [bytes] of what was printed in which the last line is looked for
WHOLE_S = 0.2  # [s] in which what an ended process has printed is read; a disk may hang
CHUNK = 65_536  # [bytes]
NO_MEMORY_S = 0.1  # [s] until it is tried again


@dataclass(frozen=True, slots=True)
class Task:
    """A command to run as a process, under a name."""

    name: str
    command: list[str]
    log: Path  # its stdout and stderr
    stop_order: int = 0  # tasks with a lower number are stopped first
    parts: tuple[str, ...] = ()  # what runs in it, where that is more than its name says
    needed: bool = True  # False: the others go on without it, if it cannot start

    @property
    def in_words(self) -> str:
        """For people: `onboard (estimation, reference)`."""
        return f"{self.name} ({', '.join(self.parts)})" if self.parts else self.name


class Child(Protocol):
    """A process that was started."""

    @property
    def printed(self) -> IO[bytes] | None:
        """What it prints; None: that is read elsewhere."""
        ...

    @property
    def pid(self) -> int: ...

    def ended(self) -> int | None:
        """Its exit status (minus the signal that ended it), or None while it runs."""
        ...

    def terminate(self) -> None:
        """Ask it to end."""
        ...

    def kill(self) -> None:
        """End it, and everything it has started."""
        ...


class OsChild:
    """A process of the operating system, in a session of its own, so that Ctrl-C in the terminal
    reaches only this program. Started, never forked: Zenoh's threads would not survive in a forked
    copy."""

    def __init__(self, task: Task) -> None:
        """
        Raises:
            OSError: it cannot be started now.
        """
        self._process = subprocess.Popen(
            task.command,
            stdin=system.STDIN,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            **system.APART,
        )
        self.printed: IO[bytes] | None = self._process.stdout

    @property
    def pid(self) -> int:
        return self._process.pid

    def ended(self) -> int | None:
        if self._process.returncode is None and self._process.poll() is not None:
            system.kill_all(self._process)  # processes it started must not outlive it
        return self._process.returncode

    def terminate(self) -> None:
        system.ask_to_end(self._process)

    def kill(self) -> None:
        system.kill_all(self._process)
        # One that waits for a dead disk does not even end now, and must not hold up the others.
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(KILL_S)


def is_stuck(pid: int) -> bool:
    """Does a process do nothing, nor wait for a processor or a disk? False also where nobody can
    tell, as on another system than Linux."""
    try:
        files = Path(f"/proc/{pid}/task").glob("*/stat")
        stats = [path.read_text(encoding="utf-8") for path in files]
    except OSError:  # a thread has just ended
        return False
    return bool(stats) and all(stat.rpartition(")")[2].split()[0] in IDLE for stat in stats)


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
