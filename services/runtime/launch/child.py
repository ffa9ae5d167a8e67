"""One child process: start, watch, end; and the file with what it prints."""

import contextlib
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import IO, Protocol

from services.runtime.config.disk import reason
from services.runtime.os import system

KILL_S = 0.5  # [s] in which a killed process is normally gone
IDLE = "STt"  # states of a thread: asleep, stopped, stopped by a debugger
WHOLE_S = 0.2  # [s] in which what an ended process has printed is read; a disk may hang
LONGEST = 65_536  # [bytes] of a line


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
    def pid(self) -> int: ...

    @property
    def unlogged(self) -> str:
        """Why what it prints is not kept; empty: it is."""
        ...

    def last_line(self) -> str:
        """That it has printed, of one that has ended; empty if nothing."""
        ...

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
    copy.

    What it prints goes through a thread into its log: on a disk that is full or hangs whoever
    prints goes on, until the pipe is full. The file is appended to, and for its owner alone: with
    the address in the cockpit's log whoever reads it could fly.
    """

    def __init__(self, task: Task) -> None:
        """Raises OSError: it cannot be started now."""
        self.unlogged, self._last = "", b""
        self._path = task.log
        self._file: IO[bytes] | None = None
        self._process = subprocess.Popen(
            task.command,
            stdin=system.STDIN,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            **system.APART,
        )
        assert self._process.stdout is not None
        self._log = Thread(target=self._copy, args=(self._process.stdout,), daemon=True)
        try:
            self._log.start()
        except RuntimeError:
            with self._process:  # which closes its pipes
                self.kill()
            raise OSError("this computer has no room for another thread") from None

    @property
    def pid(self) -> int:
        return self._process.pid

    def last_line(self) -> str:
        self._log.join(WHOLE_S)
        return self._last.decode(errors="replace").strip()

    def ended(self) -> int | None:
        status, stdin = self._process.poll(), self._process.stdin
        if status is not None and stdin is not None and not stdin.closed:
            system.kill_all(self._process)  # processes it started must not outlive it
            stdin.close()
        return status

    def terminate(self) -> None:
        system.ask_to_end(self._process)

    def kill(self) -> None:
        system.kill_all(self._process)
        # One that waits for a dead disk does not even end now, and must not hold up the others.
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(KILL_S)

    def _copy(self, printed: IO[bytes]) -> None:
        with printed:
            self._keep(b"")  # the log is there, also of who prints nothing
            while line := printed.readline(LONGEST):
                self._last = line if line.strip() else self._last
                self._keep(line)
        if self._file is not None:
            self._file.close()

    def _keep(self, line: bytes) -> None:
        """Where it cannot be written the pipe is emptied all the same: a service matters more than
        what it prints."""
        try:
            if self._file is None:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT
                self._file = os.fdopen(os.open(self._path, flags, 0o600), "ab", 0)
            while line:  # a disk that gets full takes a part of it, and then nothing
                line = line[self._file.write(line) or 0 :]
        except OSError as error:
            self.unlogged = f"cannot write {self._path}: {reason(error)}"


def is_stuck(pid: int) -> bool:
    """Does a process do nothing, nor wait for a processor or a disk? False also where nobody can
    tell, as on another system than Linux."""
    try:
        files = Path(f"/proc/{pid}/task").glob("*/stat")
        stats = [path.read_text(encoding="utf-8") for path in files]
    except OSError:  # a thread has just ended
        return False
    return bool(stats) and all(stat.rpartition(")")[2].split()[0] in IDLE for stat in stats)
