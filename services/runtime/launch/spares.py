"""Spare processes: started before they are needed, so that what is started next takes no time for
its imports. They end with this program, however it ends: their stdin closes with it."""

import select
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from typing import IO

import msgspec

from services.runtime.hosts.spare import Spare, Work
from services.runtime.launch.child import Child, OsChild, Task, started

PYTHON = [sys.executable, "-P", "-m", "services"]  # -P: nothing in the user's folder is imported
LONGEST = 32_768  # [bytes] of what a spare is told: a pipe takes more without being read
END_S = 2.0  # [s] for a spare that is not needed to end by itself

Process = subprocess.Popen[bytes]


class Spares:
    """At most one spare for each name of a task. `child` may be called from any thread."""

    def __init__(self) -> None:
        self._waiting: dict[str, Process] = {}

    def keep(self, wanted: Mapping[str, Spare]) -> None:
        """Start one that is missing, if there is any. One imports after the other, so that they
        leave the processor to whoever flies; call it again and again."""
        for name, process in list(self._waiting.items()):
            if process.poll() is not None:  # what is wrong is said by the process that is needed
                del self._waiting[name]
                _close(process)
                return
            if not _has_imported(process):
                return
        for name, spare in wanted.items():
            if name not in self._waiting:
                self._waiting[name] = _started(spare)
                return

    @property
    def ready(self) -> set[str]:
        """Names of those that have imported everything."""
        return {name for name, process in self._waiting.items() if _has_imported(process)}

    @property
    def pids(self) -> dict[str, int]:
        return {name: process.pid for name, process in self._waiting.items()}

    def child(self, task: Task) -> Child:
        """A process with this task: a spare, or, where there is none, a new one."""
        return OsChild(task, self._start)

    def end(self) -> None:
        """End those that were not needed."""
        for process in self._waiting.values():
            _close(process)
        for process in self._waiting.values():
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._waiting.clear()

    def _start(self, task: Task, log: IO[bytes]) -> Process:
        spare = self._waiting.pop(task.name, None)
        if spare is None:
            return started(task, log)
        if _told(spare, task, log):
            return spare
        spare.kill()
        spare.wait()
        return started(task, log)


def _started(spare: Spare) -> Process:
    return subprocess.Popen(
        [*PYTHON, "spare", msgspec.json.encode(spare).decode()],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _has_imported(process: Process) -> bool:
    """It then has closed its stdout, into which nothing is ever read here."""
    assert process.stdout is not None
    return process.stdout.closed or bool(select.select([process.stdout], [], [], 0.0)[0])


def _told(spare: Process, task: Task, log: IO[bytes]) -> bool:
    """Hand a spare its task. False: it has ended, or the task is too long."""
    work = Work(task.command[len(PYTHON) :], str(log.name))
    line = msgspec.json.encode(work) + b"\n"
    assert spare.stdin is not None
    told = spare.poll() is None and len(line) <= LONGEST
    try:
        if told:
            spare.stdin.write(line)
            spare.stdin.flush()
    except OSError:
        told = False
    _close(spare)
    return told


def _close(process: Process) -> None:
    for pipe in (process.stdin, process.stdout):
        with suppress(OSError):
            if pipe is not None:
                pipe.close()
