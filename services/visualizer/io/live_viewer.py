"""The live viewer, fed by a process of its own.

rerun's client blocks when a viewer stalls, and then even the end of the process hangs. So batches
go through a pipe to `viewer_process.py`, which may stall or crash without affecting the visualizer:
only a thread waits for it. The viewer's window stays open after the dive, until the user closes it.
"""

import contextlib
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import IO

import msgspec

from messages import events
from messages.events import Event, Level
from services.marine.vehicle import Vehicle
from services.runtime.os import system
from services.visualizer.batch import Batch

WAITING_BYTES = 16_000_000  # with more than this unread, a batch is dropped
LENGTH_BYTES = 4  # before each batch
END_S = 2.0  # for the viewer process to finish after the pipe is closed

Tell = Callable[[Event], None]
Log = Callable[[Level, str], None]


class ViewerLaunch(msgspec.Struct):
    """The viewer process's only argument."""

    recording_id: str
    vehicle: Vehicle
    viewer: list[str]  # program and arguments, without the port


class LiveViewer:
    """The visualizer's end of the pipe."""

    def __init__(
        self, recording_id: str, vehicle: Vehicle, viewer: list[str], tell: Tell, log: Log
    ) -> None:
        self._tell = tell
        self._log = log
        self._waiting = deque[bytes]()  # for the pipe
        self._changed = threading.Condition()  # of it, and of:
        self._size = 0  # [bytes] of what waits
        self._closing = self._broken = False
        self._encode = msgspec.msgpack.Encoder().encode
        launch = msgspec.json.encode(ViewerLaunch(recording_id, vehicle, viewer)).decode()
        self.process: subprocess.Popen[bytes] | None = subprocess.Popen(
            [sys.executable, "-P", "-m", f"{__package__}.viewer_process", launch],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            bufsize=0,
            **system.APART,  # Ctrl-C ends the dive first; the dive ends this process
        )
        assert self.process.stdin is not None
        threading.Thread(target=self._feed, args=(self.process.stdin,), daemon=True).start()
        log(
            "info",
            "opening the rerun viewer (it sends usage statistics to its developers unless you "
            "run `rerun analytics disable`)",
        )

    def send(self, batch: Batch) -> None:
        """Send a batch, or drop and count it. Never blocks."""
        if self.process is None:
            return
        frame = self._encode(batch)
        with self._changed:
            broken, full = self._broken, self._size + len(frame) > WAITING_BYTES
            if not full:
                self._waiting.append(len(frame).to_bytes(LENGTH_BYTES, "big") + frame)
                self._size += len(frame)
                self._changed.notify()
        if broken:
            self._lose()
        elif full:
            self._tell(events.DROPPED_LIVE())

    def close(self) -> None:
        """Wait for the viewer process to finish, at most `END_S`."""
        if self.process is not None:
            self._end(self.process)

    def _lose(self) -> None:
        assert self.process is not None
        self._end(self.process)
        self._tell(events.LOST_LIVE_VIEWER())
        self._log(
            "warning",
            "the live viewer was closed or could not open a window; the recording continues",
        )

    def _end(self, process: subprocess.Popen[bytes]) -> None:
        self.process = None
        with self._changed:
            self._closing = True
            self._changed.notify()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _feed(self, pipe: IO[bytes]) -> None:
        """On the thread of its own: everything that waits, then the end."""
        with contextlib.suppress(OSError), pipe:
            while (frame := self._next()) is not None:
                while frame:
                    frame = frame[pipe.write(frame) :]
        with self._changed:
            self._broken = True

    def _next(self) -> bytes | None:
        """Wait for what is to be sent; None: there is nothing, and nothing will come."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closing)
            if not self._waiting:
                return None
            frame = self._waiting.popleft()
            self._size -= len(frame) - LENGTH_BYTES
            return frame


def viewer_command() -> list[str]:
    """The viewer itself: the `rerun` on the path is a wrapper that leaves it running when ended,
    and without `--bind` it would listen on all network interfaces."""
    spec = find_spec("rerun_cli")
    folder = Path(spec.origin).parent if spec is not None and spec.origin else Path()
    program = folder / ("rerun.exe" if os.name == "nt" else "rerun")
    return [str(program), "--bind", "127.0.0.1", "--hide-welcome-screen"]
