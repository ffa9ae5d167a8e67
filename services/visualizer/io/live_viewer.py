"""The live viewer, fed by a process of its own.

rerun's client blocks when a viewer stalls, and then even the end of the process hangs. So batches
go through a pipe to a process that opens the viewer and may stall or crash without affecting the
visualizer: only a thread waits for it. It ends by itself, even when its parent has already ended.
The viewer's window stays open after the dive, until the user closes it.
"""

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from queue import Full, Queue
from typing import IO, TYPE_CHECKING, BinaryIO

import msgspec

from messages import events
from messages.events import Event, Level
from services.marine.vehicle import Vehicle
from services.runtime.os import system
from services.visualizer.batch import Batch

if TYPE_CHECKING:
    from services.visualizer.io.rerun_writer import RerunWriter

os.environ.setdefault("RUST_LOG", "warn")  # rerun's own log on stderr, before it is imported
MOST_WAITING = 256  # batches that are not read yet, ten seconds; more are dropped
LENGTH_BYTES = 4  # before each batch
END_S = 2.0  # for the viewer process to finish after the pipe is closed
OPEN_S = 20.0  # for the viewer to listen
STALL_S = 10  # a viewer that takes nothing for this long is given up

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
        self._waiting: Queue[bytes | None] = Queue(MOST_WAITING)  # for the pipe; None: the end
        self._encode = msgspec.msgpack.Encoder().encode
        launch = msgspec.json.encode(ViewerLaunch(recording_id, vehicle, viewer)).decode()
        self.process: subprocess.Popen[bytes] | None = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, launch],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            **system.APART,  # Ctrl-C ends the dive first; the dive ends this process
        )
        assert self.process.stdin is not None
        self._feeder = threading.Thread(target=self._feed, args=(self.process.stdin,), daemon=True)
        self._feeder.start()
        log(
            "info",
            "opening the rerun viewer (it sends usage statistics to its developers unless you "
            "run `rerun analytics disable`)",
        )

    def send(self, batch: Batch) -> None:
        """Send a batch, or drop and count it. Never blocks."""
        if self.process is None:
            return
        if not self._feeder.is_alive():  # the pipe is broken
            self._lose()
            return
        try:
            self._waiting.put_nowait(self._encode(batch))
        except Full:
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
        with suppress(Full):
            self._waiting.put_nowait(None)
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _feed(self, pipe: IO[bytes]) -> None:
        """On the thread of its own: everything that waits, then the end."""
        with suppress(OSError), pipe:
            while (frame := self._waiting.get()) is not None:
                pipe.write(len(frame).to_bytes(LENGTH_BYTES, "big") + frame)
                pipe.flush()


def viewer_command() -> list[str]:
    """The viewer itself: the `rerun` on the path is a wrapper that leaves it running when ended,
    and without `--bind` it would listen on all network interfaces."""
    spec = find_spec("rerun_cli")
    folder = Path(spec.origin).parent if spec is not None and spec.origin else Path()
    program = folder / ("rerun.exe" if os.name == "nt" else "rerun")
    return [str(program), "--bind", "127.0.0.1", "--hide-welcome-screen"]


# The process of its own.


def main(argument: str) -> int:
    from services.visualizer.io.rerun_writer import RerunWriter

    launch = msgspec.json.decode(argument, type=ViewerLaunch)
    port = free_port()
    viewer = subprocess.Popen(
        [*launch.viewer, "--port", str(port)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        **system.APART,  # the window outlives the dive
    )
    if not answers(port, viewer, OPEN_S):
        viewer.kill()
        return 1
    writer = RerunWriter(launch.recording_id, launch.vehicle)
    system.end_within(STALL_S)
    writer.connect(f"rerun+http://127.0.0.1:{port}/proxy")
    _draw(writer, sys.stdin.buffer, viewer)
    system.end_within(STALL_S)
    writer.close()
    return 0


def _draw(writer: "RerunWriter", pipe: BinaryIO, viewer: subprocess.Popen[bytes]) -> None:
    """Send batches until the pipe is closed or the viewer has ended."""
    decoder = msgspec.msgpack.Decoder(Batch)
    system.end_within(0)
    while (head := pipe.read(LENGTH_BYTES)) and viewer.poll() is None:
        batch = decoder.decode(pipe.read(int.from_bytes(head, "big")))
        system.end_within(STALL_S)
        writer.write(batch)
        system.end_within(0)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def answers(port: int, viewer: subprocess.Popen[bytes], seconds: float) -> bool:
    """Does the viewer listen within this time?"""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and viewer.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", port), 0.5).close()
            return True
        except OSError:
            time.sleep(0.1)
    return False


if __name__ == "__main__":
    try:
        status = main(sys.argv[1])
    except Exception:  # the pipe's other end reports it
        status = 1
    os._exit(status)  # a normal exit would wait for a viewer that may never answer
