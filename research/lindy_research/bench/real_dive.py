"""Real dives of this machine: `lindy` started as a user does, and watched from outside."""

import os
import subprocess
import sys
import time
from collections.abc import Collection, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path

import msgspec

from lindy.api import LindyError
from lindy_research.bench.costs import Cost, costs
from services.runtime.config.running import RUNNING, Running
from tools.report.report import Report

LINDY = (sys.executable, "-P", "-m", "lindy")
PATIENCE_S = 120.0  # [s] for anything that happens in a moment on an idle computer
SETTLE_S = 2.0  # [s] after arming, before it is watched
WATCH_S = 12.0  # [s] of steady flight
QUICK = ("--set", "estimation.calibration.still_time=3")  # [s] less to wait for
PILOT = ("--pilot", "script:first_dive")  # a minute and a half
HAS_STICKS = "has the sticks"  # the pilot's line when the drone is armed


class RealDive:
    """One `lindy` command that is running. Its folder is `out`."""

    def __init__(self, out: Path, words: Collection[str], environment: Mapping[str, str]) -> None:
        self._out, self._screen = out, out.with_suffix(".txt")
        with self._screen.open("w") as screen:
            self._process = subprocess.Popen(
                [*LINDY, *words, *QUICK, "--out", str(out)], stdin=subprocess.DEVNULL,
                stdout=screen, stderr=subprocess.STDOUT, env=os.environ | dict(environment),
            )  # fmt: skip

    def until_said(self, text: str) -> None:
        """Wait for a line on its screen.

        Raises:
            LindyError: it ended, or takes too long.
        """
        deadline = time.monotonic() + PATIENCE_S
        while text not in (said := self._screen.read_text()):
            if self._process.poll() is not None or time.monotonic() > deadline:
                last = (said.strip().splitlines() or ["it printed nothing"])[-1]
                raise LindyError(f"a dive of the benchmark does not get to {text!r}: {last}")
            time.sleep(0.05)

    def running(self) -> Running:
        """Where it can be reached."""
        return msgspec.json.decode((self._out / RUNNING).read_bytes(), type=Running)

    def pids(self) -> dict[str, int]:
        """Its supervisor, hubs and services; of services that share a process, one."""
        running = self.running()
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
def started(
    out: Path, *words: str, environment: Mapping[str, str] | None = None
) -> Generator[RealDive]:
    """
    Args:
        environment: variables, besides those of this process.
    """
    dive = RealDive(out, words, environment or {})
    try:
        yield dive
    finally:
        dive.end()


def watched(
    dives: Collection[RealDive], pilots: Collection[RealDive], seconds: float = WATCH_S
) -> dict[str, Cost]:
    """What each process of these dives costs, while all pilots fly."""
    for pilot in pilots:
        pilot.until_said(HAS_STICKS)
    time.sleep(SETTLE_S)  # the first seconds after arming are not steady
    return costs(
        {f"{n}/{name}": pid for n, dive in enumerate(dives) for name, pid in dive.pids().items()},
        seconds,
    )
