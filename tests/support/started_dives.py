"""Real dives: `lindy` started as a user does, and watched from outside."""

import subprocess
import sys
from collections.abc import Collection, Generator
from contextlib import contextmanager
from pathlib import Path

import msgspec

from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running
from tests.support.patience import PATIENCE_S, until
from tools.report.report import Report

QUICK = ("--set", "estimation.calibration.still_time=3")  # [s] less to wait for
PILOT = ("--pilot", "script:first_dive")  # a minute and a half
HAS_STICKS = "has the sticks"  # the pilot's line when the drone is armed


class StartedDive:
    """One `lindy` command that is running. Its folder is `out`."""

    def __init__(self, out: Path, words: Collection[str]) -> None:
        self._out, self._screen = out, out.with_suffix(".txt")
        command = [sys.executable, "-P", "-m", "tools", *words, *QUICK, "--out", str(out)]
        with self._screen.open("w") as screen:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=screen, stderr=subprocess.STDOUT
            )

    def until_said(self, text: str) -> None:
        """Wait for a line on its screen.

        Raises:
            LindyError: it ended.
        """

        def require_running() -> None:
            if self._process.poll() is not None:
                last = (self._screen.read_text().strip().splitlines() or ["it printed nothing"])[-1]
                raise LindyError(f"a dive does not get to {text!r}: {last}")

        until(lambda: text in self._screen.read_text(), self._screen.read_text, require_running)

    def pids(self) -> dict[str, int]:
        """Its supervisor, hubs and services; of services that share a process, one."""
        running = msgspec.json.decode((self._out / RUNNING).read_bytes(), type=Running)
        by_pid = {pid: name for name, pid in running.pids.items()}
        return {name: pid for pid, name in by_pid.items()} | {"supervisor": running.supervisor}

    def report(self) -> Report:
        """End it, and read its report."""
        self.end()
        return msgspec.json.decode((self._out / "report.json").read_bytes(), type=Report)

    def end(self) -> None:
        """As Ctrl-C does."""
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait(PATIENCE_S)


@contextmanager
def started(out: Path, *words: str) -> Generator[StartedDive]:
    dive = StartedDive(out, words)
    try:
        yield dive
    finally:
        dive.end()
