"""`run.json` in a dive's folder, by which other programs find the dive that is going on."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import msgspec

from services.runtime.config.disk import reason
from services.runtime.config.running import RUNNING, Running
from services.runtime.launch.process_plan import ProcessPlan

RETRY_NS = 5_000_000_000  # [ns]


class RunNote:
    """Removed at the end of the dive."""

    def __init__(self, plan: ProcessPlan, warn: Callable[[str], None]) -> None:
        self.shown = True  # False: `lindy ask` is to find another dive of this program
        self.changes = False  # the pilot of this dive may take another drone
        self._plan, self._warn = plan, warn
        self._path = plan.stack.out_dir / RUNNING
        self._pids: dict[str, int] = {}
        self._again_ns: int | None = None  # [ns] when a write that failed is tried again
        self._left_for = ""

    def update(self, pids: dict[str, int], now: int) -> None:
        """Written atomically: on a full disk the older one stays, which is said once, and it is
        tried again.

        Args:
            pids: of the processes, by the names of their services and of the hubs.
            now: [ns] by any clock.
        """
        due = self._again_ns is not None and now >= self._again_ns
        if self.shown and (pids != self._pids or due):
            self._pids = pids
            self._again_ns = None if self._write(pids) else now + RETRY_NS

    def leave(self, folder: Path) -> None:
        """The pilot flies the dive in that folder now: this one leads there, also after `remove`,
        and is not found by itself any more."""
        self.shown, self._left_for = False, str(folder)
        self._write({})

    def remove(self) -> None:
        if not self._left_for:
            with suppress(OSError):  # the disk may be read-only by now
                self._path.unlink(missing_ok=True)

    def _write(self, pids: dict[str, int]) -> bool:
        """Whether the disk took it."""
        plan, own = self._plan, os.getpid()
        running = Running(
            vehicle=plan.stack.space,
            endpoints=plan.endpoints,
            supervisor=own,
            pids=pids,
            stack_file=str(plan.services.file),
            left_for=self._left_for,
            changes=self.changes,
        )
        fresh = self._path.with_name(f".{RUNNING}-{own}")
        try:
            fresh.write_bytes(msgspec.json.format(msgspec.json.encode(running)))
            fresh.replace(self._path)
        except OSError as error:
            with suppress(OSError):
                fresh.unlink(missing_ok=True)
            if self._again_ns is None:
                self._warn(f"cannot write {self._path}: {reason(error)}")
            return False
        return True
