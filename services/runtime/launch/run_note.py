"""`run.json` in a dive's folder, by which other programs find the dive that is going on."""

import os
from collections.abc import Callable
from contextlib import suppress

import msgspec

from services.runtime.config.running import RUNNING, Running
from services.runtime.launch.process_plan import ProcessPlan
from services.runtime.node.checkpoint import CheckpointFile
from services.runtime.os import system

RETRY_NS = 5_000_000_000  # [ns]


class RunNote:
    """Removed at the end of the dive. Written by a thread of its own: a disk that hangs must not
    hold up whoever supervises."""

    def __init__(self, plan: ProcessPlan, warn: Callable[[str], None]) -> None:
        self._plan, self._warn = plan, warn
        self._path = plan.stack.out_dir / RUNNING
        self._file = CheckpointFile(self._path)
        self._pids: dict[str, int] = {}
        self._again_ns: int | None = None  # [ns] when a write that failed is tried again
        self._said = False

    def update(self, pids: dict[str, int], now: int) -> None:
        """Written atomically: on a full disk the older one stays, which is said once, and it is
        tried again.

        Args:
            pids: of the processes, by the names of their services and of the hubs.
            now: [ns] by any clock.
        """
        self._said = self._said and bool(self._file.why)
        if self._file.failures():
            self._again_ns = now + RETRY_NS
            if not self._said:
                self._said = True
                self._warn(f"cannot write {self._path}: {self._file.why}")
        due = self._again_ns is not None and now >= self._again_ns
        if pids != self._pids or due:
            self._pids, self._again_ns = pids, None
            self._write(pids)

    def remove(self) -> None:
        self._file.close()
        with suppress(OSError):  # the disk may be read-only by now
            self._path.unlink(missing_ok=True)

    def _write(self, pids: dict[str, int]) -> None:
        plan = self._plan
        running = Running(
            vehicle=plan.stack.space,
            endpoints=plan.endpoints,
            supervisor=os.getpid(),
            began=system.began(os.getpid()),
            pids=pids,
            stack_file=str(plan.services.file),
        )
        self._file.save_checkpoint(msgspec.json.format(msgspec.json.encode(running)))
