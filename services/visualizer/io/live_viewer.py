"""The live viewer, kept at arm's length: a process of its own does the talking.

rerun's client blocks when a viewer stalls, and then even the end of the process hangs. So batches
go through a pipe that is never waited for to `feeder.py`, which may stall or die as it likes. The
viewer's window belongs to the user: it stays open after the dive, until he closes it.
"""

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import msgspec

from services.marine.vehicle import Vehicle
from services.visualizer.batch import Batch

WAITING_BYTES = 16_000_000  # more than this unread, and a batch is left out
LENGTH_BYTES = 4  # before each batch
END_S = 2.0  # for the feeder to finish after the pipe is closed

Count = Callable[[str], None]
Log = Callable[[Literal["info", "warning", "error"], str], None]


class ViewerLaunch(msgspec.Struct):
    """The feeder's only argument."""

    recording_id: str
    vehicle: Vehicle
    viewer: list[str]  # program and arguments, but for its port


class LiveViewer:
    """Our end of the pipe."""

    def __init__(
        self, recording_id: str, vehicle: Vehicle, viewer: list[str], count: Count, log: Log
    ) -> None:
        self._count = count
        self._log = log
        self._waiting = bytearray()
        self._encode = msgspec.msgpack.Encoder().encode
        hello = msgspec.json.encode(ViewerLaunch(recording_id, vehicle, viewer)).decode()
        self.process: subprocess.Popen[bytes] | None = subprocess.Popen(
            [sys.executable, "-m", "services.visualizer.io.viewer_process", hello],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C ends the dive first, and the dive ends the feeder
        )
        assert self.process.stdin is not None
        self._pipe = self.process.stdin.fileno()
        os.set_blocking(self._pipe, False)
        log(
            "info",
            "opening the rerun viewer (it sends usage figures to its makers unless you "
            "say `rerun analytics disable`)",
        )

    def send(self, batch: Batch) -> None:
        """Pass a batch on, or leave it out and count it. Never waits."""
        if self.process is None:
            return
        frame = self._encode(batch)
        if len(self._waiting) + len(frame) > WAITING_BYTES:
            self._count("dropped:live")
        else:
            self._waiting += len(frame).to_bytes(LENGTH_BYTES, "big") + frame
        try:
            while self._waiting and (written := os.write(self._pipe, self._waiting)):
                del self._waiting[:written]
        except BlockingIOError:
            pass  # the feeder is behind; the rest goes with the next batch
        except OSError:
            self._lose()

    def close(self) -> None:
        """Let the feeder finish what it has, but not for long."""
        if self.process is not None:
            self._end(self.process)

    def _lose(self) -> None:
        assert self.process is not None
        self._end(self.process)
        self._count("lost:live_viewer")
        self._log(
            "warning", "the live viewer is gone or could not open a window; the recording goes on"
        )

    def _end(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        self.process = None
        self._waiting.clear()
        with contextlib.suppress(OSError):
            process.stdin.close()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def viewer_command() -> list[str]:
    """The viewer itself: the `rerun` on the path is a wrapper that leaves it behind when ended,
    and without `--bind` it would listen to the whole network."""
    spec = find_spec("rerun_cli")
    folder = Path(spec.origin).parent if spec is not None and spec.origin else Path()
    program = folder / ("rerun.exe" if os.name == "nt" else "rerun")
    return [str(program), "--bind", "127.0.0.1", "--hide-welcome-screen"]
