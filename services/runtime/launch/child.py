"""One child process: start, watch, end."""

import contextlib
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Protocol

from services.runtime.os import system

KILL_S = 0.5  # [s] in which a killed process is normally gone
IDLE = "STt"  # states of a thread: asleep, stopped, stopped by a debugger


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
