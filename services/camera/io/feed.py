"""Pictures from a device, the network or a file, by FFmpeg.

A thread of its own waits for them and keeps the newest one. A camera that is not there, vanishes or
sends garbage is said once and tried again every two seconds.
"""

import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import av
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError

from messages.units import Ns
from services.camera.sea import Bytes, Picture

RETRY_S = 2.0  # [s]
TIMEOUT_S = 5.0  # [s] for an answer from the network
LARGEST = 8192  # [px] of a side of a picture that is taken
# Nothing is collected before the first picture is shown.
AT_ONCE = {"fflags": "nobuffer", "flags": "low_delay"}


class Shot(NamedTuple):
    """A picture in memory."""

    picture: Picture
    stamp_ns: Ns  # when it came from the camera
    captured_ns: Ns  # when it was decoded and scaled


class Feed:
    """Keeps the newest picture of one source. `counts` is taken and cleared by the service."""

    def __init__(self, source: str, width: int, height: int, clock: Callable[[], Ns]) -> None:
        self.counts: Counter[str] = Counter()
        self.said: list[str] = []  # sentences for the log
        self._source, self._size, self._clock = source, (width, height), clock
        self._newest: Shot | None = None
        self._trouble = ""
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, notify: Callable[[], None]) -> None:
        """Begin; `notify` is called when there is a picture, or something to say."""
        self._thread = threading.Thread(target=self._run, args=(notify,), daemon=True)
        self._thread.start()

    def take(self) -> Shot | None:
        """The newest picture, once."""
        newest, self._newest = self._newest, None
        return newest

    def close(self) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join(1.0)

    # On the thread of its own.

    def _run(self, notify: Callable[[], None]) -> None:
        while not self._stop.is_set():
            why = "it ended"
            try:
                with self._opened() as container:
                    self._watch(container, notify)
            except (FFmpegError, OSError, ValueError, IndexError, MemoryError) as error:
                why = " ".join(str(error).split())[:200]
            if not self._stop.is_set():
                self._complain(why)
                notify()
                self._stop.wait(RETRY_S)

    def _opened(self) -> InputContainer:
        source, timeout = self._source, (TIMEOUT_S, TIMEOUT_S)
        if source.startswith("/dev/"):
            return av.open(source, format="v4l2", options=AT_ONCE, timeout=timeout)
        if "://" in source:
            return av.open(source, options=AT_ONCE, timeout=timeout)
        if source.endswith(".sdp"):  # says what an RTP stream is
            among = {"protocol_whitelist": "file,udp,rtp"}
            return av.open(source, options=AT_ONCE | among, timeout=timeout)
        return av.open(source)

    def _watch(self, container: InputContainer, notify: Callable[[], None]) -> None:
        """Every picture of an open source; a file from its beginning again and again."""
        paced = Path(self._source).is_file() and not self._source.endswith(".sdp")
        while not self._stop.is_set():
            before = self._pass(container, notify, paced=paced)
            if not (paced and before):
                return
            container.seek(0)

    def _pass(self, container: InputContainer, notify: Callable[[], None], *, paced: bool) -> int:
        """Until the source ends. Returns how many pictures there were."""
        stream = container.streams.video[0]
        began, number = self._clock(), 0
        for number, frame in enumerate(container.decode(stream), 1):
            if paced:
                wait = began + round((frame.time or 0.0) * 1e9) - self._clock()
                self._stop.wait(min(max(wait / 1e9, 0.001), 1.0))
            if self._stop.is_set():
                return number
            self._keep(frame)
            notify()
        return number

    def _keep(self, frame: av.VideoFrame) -> None:
        stamp = self._clock()
        if max(frame.width, frame.height) > LARGEST:
            raise ValueError(f"its pictures have {frame.width} x {frame.height} pixels")
        picture = planes(frame.reformat(*self._size, format="yuv420p"))
        if self._newest is not None:
            self.counts["skipped:picture"] += 1
        self._newest = Shot(picture, stamp, self._clock())
        if self._trouble:
            self._trouble = ""
            self.said.append(f"camera: {self._source} gives pictures again")

    def _complain(self, why: str) -> None:
        self.counts["lost:camera"] += 1
        if why != self._trouble:
            self._trouble = why
            self.said.append(f"camera: {self._source} gives no pictures: {why}; tried every 2 s")


def planes(frame: av.VideoFrame) -> Picture:
    """Copies of the planes of a frame in the format yuv420p."""
    height, width = frame.height, frame.width
    sizes = (height, width), (height // 2, width // 2), (height // 2, width // 2)
    return Picture(*(_plane(frame, k, *size) for k, size in enumerate(sizes)))


def _plane(frame: av.VideoFrame, k: int, height: int, width: int) -> Bytes:
    plane = frame.planes[k]
    rows = np.frombuffer(bytes(plane), np.uint8).reshape(-1, plane.line_size)
    return rows[:height, :width]
