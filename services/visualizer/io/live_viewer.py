"""The live viewer: rerun's own program, which reads from a pipe what the file gets.

A viewer that stalls fills the pipe: then a thread waits for it, and batches are dropped. Its window
stays open after the dive, until the user closes it.
"""

import os
import subprocess
import threading
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from queue import Full, Queue

from messages import events
from services.runtime.os import system
from services.visualizer.io.rrd_file import HEADER_BYTES, Log, Tell, index_at

os.environ.setdefault("RUST_LOG", "warn")  # rerun's own log on stderr, before it is imported
MOST_WAITING = 256  # batches that are not read yet, ten seconds; more are dropped
END_S = 2.0  # for the viewer to read what waits, after the dive


class LiveViewer:
    """Takes rerun's encoded batches, as `RrdFile` does. Never blocks."""

    def __init__(self, command: list[str], tell: Tell, log: Log) -> None:
        """`command`: program and arguments of what reads them from its standard input."""
        self._tell, self._log = tell, log
        self._waiting: Queue[bytes | None] = Queue(MOST_WAITING)  # for the pipe; None: the end
        self._feeder = threading.Thread(target=self._feed, daemon=True)
        self.viewer: subprocess.Popen[bytes] | None = None
        self.is_open = True
        log(
            "info",
            "opening the rerun viewer (it sends usage statistics to its developers unless you "
            "run `rerun analytics disable`)",
        )
        with suppress(OSError):
            self.viewer = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                **system.APART,  # the window outlives the dive, and Ctrl-C
            )
        self._feeder.start()

    def begin(self, data: bytes) -> None:
        self._send(data[: index_at(data)])

    def append(self, data: bytes) -> None:
        """Send a batch, or drop and count it."""
        self._send(data[HEADER_BYTES : index_at(data)])

    def close(self) -> None:
        """Wait until all is read, at most `END_S`."""
        with suppress(Full):
            self._waiting.put(None, timeout=END_S)
            self._feeder.join(END_S)

    def _send(self, messages: bytes) -> None:
        if self.is_open and not self._feeder.is_alive():  # the pipe is broken, or there is none
            self.is_open = False
            self._tell(events.LOST_LIVE_VIEWER())
            self._log(
                "warning",
                "the live viewer was closed or could not open a window; the recording continues",
            )
        try:
            self._waiting.put_nowait(messages)
        except Full:
            self._tell(events.DROPPED_LIVE())

    def _feed(self) -> None:
        """On the thread of its own: everything that waits, then the end."""
        if self.viewer is None or self.viewer.stdin is None:
            return
        with suppress(OSError), self.viewer.stdin as pipe:
            while (messages := self._waiting.get()) is not None:
                pipe.write(messages)
                pipe.flush()


def viewer_command() -> list[str]:
    """The viewer itself: the `rerun` on the path is a wrapper that leaves it running when ended,
    and without `--bind` it would listen on all network interfaces."""
    spec = find_spec("rerun_cli")
    folder = Path(spec.origin).parent if spec is not None and spec.origin else Path()
    program = folder / ("rerun.exe" if os.name == "nt" else "rerun")
    listens = ["--bind", "127.0.0.1", "--port", "auto"]
    return [str(program), "-", *listens, "--hide-welcome-screen"]
