"""A pool of prewarmed processes: started before they are needed, so that what is started next takes
no time for its imports. They end with this program, however it ends: their stdin closes with it."""

import select
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress

import msgspec

import services
from services.runtime.hosts.prewarmed_process import Prewarming, Work
from services.runtime.launch.child import Child, OsChild, Started, Task, started
from services.runtime.os import system

PYTHON = [sys.executable, "-P", "-m", services.__name__]  # -P: nothing of the user's folder
LONGEST = 32_768  # [bytes] of what one is told: a pipe takes more without being read
END_S = 2.0  # [s] for one that is not needed to end by itself

Process = subprocess.Popen[bytes]


class ProcessPool:
    """At most one prewarmed process for each name of a task. `child` may be called from any
    thread."""

    def __init__(self) -> None:
        self._waiting: dict[str, Process] = {}

    def keep(self, wanted: Mapping[str, Prewarming]) -> None:
        """Start one that is missing, if there is any. One imports after the other, so that they
        leave the processor to whoever flies; call it again and again."""
        if not system.PREWARMS:
            return
        for name, process in list(self._waiting.items()):
            if process.poll() is not None:  # what is wrong is said by the process that is needed
                del self._waiting[name]
                _close(process)
                return
            if not _has_imported(process):
                return
        for name, prewarming in wanted.items():
            if name not in self._waiting:
                with suppress(OSError):  # nothing to start it with: said when one is needed
                    self._waiting[name] = _started(prewarming)
                return

    def has(self, name: str) -> bool:
        """Has one for this task imported everything?"""
        process = self._waiting.get(name)
        return process is not None and _has_imported(process)

    @property
    def pids(self) -> dict[str, int]:
        return {name: process.pid for name, process in self._waiting.items()}

    def child(self, task: Task) -> Child:
        """A process with this task: a prewarmed one, or, where there is none, a new one."""
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

    def _start(self, task: Task) -> Started:
        waiting = self._waiting.pop(task.name, None)
        if waiting is None:
            return started(task)
        if _told(waiting, task):
            assert waiting.stderr is not None
            return Started(waiting, waiting.stderr)
        waiting.kill()
        waiting.wait()
        _close(waiting)
        return started(task)


def _started(prewarming: Prewarming) -> Process:
    return subprocess.Popen(
        [*PYTHON, "prewarm", msgspec.json.encode(prewarming).decode()],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **system.APART,
    )


def _has_imported(process: Process) -> bool:
    """It then has closed its stdout, into which nothing is ever read here."""
    assert process.stdout is not None
    return process.stdout.closed or bool(select.select([process.stdout], [], [], 0.0)[0])


def _told(waiting: Process, task: Task) -> bool:
    """Hand a prewarmed process its task. False: it has ended, or the task is too long."""
    line = msgspec.json.encode(Work(task.command[len(PYTHON) :])) + b"\n"
    told = waiting.poll() is None and len(line) <= LONGEST
    try:
        if told:
            assert waiting.stdin is not None
            waiting.stdin.write(line)
            waiting.stdin.flush()
            _close(waiting, but=waiting.stderr)
    except OSError:
        told = False
    return told


def _close(process: Process, but: object = None) -> None:
    for pipe in (process.stdin, process.stdout, process.stderr):
        with suppress(OSError):
            if pipe is not None and pipe is not but:
                pipe.close()
