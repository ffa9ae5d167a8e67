"""A real dive of this machine, in processes, beside which something is measured."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from messages import topics
from messages.vehicle import VehicleStatus
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.config.running import RUNNING, Running
from tests.support.processes import Cost, costs

START_S = 60.0  # [s] at most, until the drone is armed
END_S = 60.0  # [s] at most, for files and report at the end
SETTLE_S = 1.0  # [s] after arming, before anything is measured
SCRIPT = """t,surge,sway,heave,yaw
0,0,0,0,0
1,0,0,0.8,0
4,0.5,0,0,0.3
12,0,0,0,0.4
16,0.3,0.3,0,0
22,0,0,-0.3,0
24,0,0,0,0
"""


class RealDive:
    """Made by `real_dive`, when the drone is armed."""

    def __init__(self, process: subprocess.Popen[bytes], out: Path, running: Running) -> None:
        self._process, self._out, self._running = process, out, running

    def costs(self, seconds: float) -> dict[str, Cost]:
        """Of every process of the dive, over the next `seconds`."""
        own = {"supervisor": self._running.supervisor}
        return costs(own | self._running.pids, seconds)

    def report(self) -> dict[str, Any]:
        """What the dive's own report says, once it has ended by itself."""
        self._process.wait(END_S)
        return json.loads((self._out / "report.json").read_text())


@contextmanager
def real_dive(seconds: float, environment: Mapping[str, str] | None = None) -> Generator[RealDive]:
    """A dive that ends by itself `seconds` after arming.

    Args:
        environment: variables, besides those of this process.
    """
    with TemporaryDirectory() as folder:
        script, out = Path(folder) / "script.csv", Path(folder) / "dive"
        script.write_text(SCRIPT)
        command = [sys.executable, "-P", "-m", "tools", "dive", "--headless"]
        command += ["--pilot", f"script:{script}", "--seconds", f"{seconds:g}", "--out", str(out)]
        command += ["--set", "estimation.calibration.still_time=3"]
        with (Path(folder) / "screen.txt").open("wb") as screen:
            process = subprocess.Popen(
                command, stdout=screen, stderr=screen, env=os.environ | dict(environment or {})
            )
        try:
            yield RealDive(process, out, _armed(out, process))
        finally:
            process.terminate()
            process.wait()


def _armed(out: Path, process: subprocess.Popen[bytes]) -> Running:
    """Wait until the drone is armed.

    Raises:
        RuntimeError: the dive ended, or took too long.
    """
    deadline = time.monotonic() + START_S

    def until(happened: Callable[[], bool]) -> None:
        while not happened():
            if process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError("the dive does not begin")
            time.sleep(0.05)  # other processes do it

    until((out / RUNNING).is_file)
    running = msgspec.json.decode((out / RUNNING).read_bytes(), type=Running)
    with open_bus(running.endpoints["topside"], running.vehicle) as bus:
        said = list[bool]()
        decode = msgspec.msgpack.Decoder(VehicleStatus).decode
        bus.hear(topics.STATUS.key, lambda envelope: said.append(decode(envelope.payload).armed))
        until(lambda: bool(said) and said[-1])
    time.sleep(SETTLE_S)
    return msgspec.json.decode((out / RUNNING).read_bytes(), type=Running)
