"""Pictures from a device, the network or a file, by FFmpeg.

A thread of its own waits for them and keeps the newest one. A camera that is not there, vanishes,
falls silent or sends garbage is said once and tried again every two seconds.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from errno import ENOTTY
from pathlib import Path
from typing import NamedTuple, cast

import av
import numpy as np
from av.codec.context import Flags2
from av.container import InputContainer
from av.error import ExitError, FFmpegError, InvalidDataError
from av.video.codeccontext import VideoCodecContext
from av.video.stream import VideoStream

from messages import events
from messages.events import Event
from messages.units import Ns
from services.camera.sea import Bytes, Picture
from services.runtime.config.passwords import without_passwords

RETRY_S = 2.0  # [s]
TIMEOUT_S = 5.0  # [s] without a picture: the camera is silent
SILENT = f"no picture has come for {TIMEOUT_S:g} s"
MOST_GARBAGE = 100  # packets in a row of which nothing can be decoded
FILM_HZ = 25.0  # [1/s] pictures of a film that does not say when each is due
LARGEST = 8192  # [px] of a side of a picture that is taken
# What a stream holds is known from its first pictures; how many a second they are is not waited
# for. What was read by then is shown, not thrown away: without its keyframe the rest is garbage.
AT_ONCE = {"fpsprobesize": "0", "analyzeduration": "1000000"}  # [µs]


class Shot(NamedTuple):
    """A picture in memory."""

    picture: Picture
    stamp_ns: Ns  # when it came from the camera
    captured_ns: Ns  # when it was decoded and scaled


class Feed:
    """Keeps the newest picture of one source. `events` and `said` are emptied by the service."""

    def __init__(self, source: str, width: int, height: int, clock: Callable[[], Ns]) -> None:
        self.events: deque[Event] = deque()
        self.said: deque[str] = deque()  # sentences for the log
        self._source, self._size, self._clock = source, (width, height), clock
        self._newest: deque[Shot] = deque(maxlen=1)
        self._called = without_passwords(source)
        self._trouble = ""
        self._alive_ns = clock()  # [ns] of the last picture, or of the last that was said
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, notify: Callable[[], None]) -> None:
        """Begin; `notify` is called when there is a picture, or something to say."""
        self._thread = threading.Thread(target=self._run, args=(notify,), daemon=True)
        self._thread.start()

    def take(self) -> Shot | None:
        """The newest picture, once."""
        return self._newest.pop() if self._newest else None

    def look_after(self, now: Ns) -> None:
        """To be called now and then: FFmpeg waits for ever for a device that is only connected."""
        if now > self._alive_ns + round((TIMEOUT_S + RETRY_S) * 1e9):
            self._complain(SILENT, now, "waiting for it")

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
                    again = self._watch(container, notify)
                if again:
                    continue
            except Exception as error:  # whatever it is, the next attempt is two seconds away
                why = reason(error)
            if not self._stop.is_set():
                self._complain(why, self._clock())
                notify()
                self._stop.wait(RETRY_S)

    def _opened(self) -> InputContainer:
        source, timeout = self._source, (TIMEOUT_S, TIMEOUT_S)
        if source.startswith("/dev/") and not Path(source).is_file():
            return av.open(source, format="v4l2", options=AT_ONCE, timeout=timeout)
        if "://" in source:
            return av.open(source, options=AT_ONCE, timeout=timeout)
        if source.endswith(".sdp"):  # says what an RTP stream is
            among = {"protocol_whitelist": "file,udp,rtp"}
            return av.open(source, options=AT_ONCE | among, timeout=timeout)
        return av.open(source)

    def _watch(self, container: InputContainer, notify: Callable[[], None]) -> bool:
        """Every picture of an open source. Returns whether it was a film, to be shown again.

        Raises:
            ValueError: it has no pictures.
        """
        if not container.streams.video:
            raise ValueError("there is no picture in it")
        stream = container.streams.video[0]
        codec = cast(VideoCodecContext | None, stream.codec_context)
        if codec is None:
            raise ValueError("the installed PyAV cannot decode its pictures")
        if codec.name == "h264":
            # GStreamer puts parameter sets before each slice of a keyframe, where FFmpeg then sees
            # as many pictures. So told, its decoder puts them together again.
            codec.flags2 |= Flags2.chunks
        film = Path(self._source).is_file() and not self._source.endswith(".sdp")
        return self._pass(container, stream, notify, film=film) > 0 and film

    def _pass(
        self, container: InputContainer, stream: VideoStream, notify: Callable[[], None], *,
        film: bool,
    ) -> int:  # fmt: skip
        """Until the source ends. Returns how many pictures there were."""
        began, first, number = self._clock(), None, 0
        rate = float(stream.average_rate or FILM_HZ)
        for number, frame in enumerate(self._frames(container, stream), 1):
            if film:
                time = number / rate if frame.pts is None else frame.time
                first = time if first is None else first  # a film that was cut does not begin at 0
                wait = began + round((time - first) * 1e9) - self._clock()
                self._stop.wait(min(max(wait / 1e9, 0.001), 1.0))
            if self._stop.is_set():
                return number
            self._keep(frame)
            notify()
        return number

    def _frames(self, container: InputContainer, stream: VideoStream) -> Iterator[av.VideoFrame]:
        """What is decoded. A packet that was damaged on its way is no reason to connect anew."""
        garbage, asked = 0, self._clock()
        for packet in container.demux(stream):
            # A wait that timed out first gives what was kept back: an old picture.
            if self._clock() > asked + round(TIMEOUT_S * 1e9):
                raise ValueError(SILENT)
            try:
                frames = packet.decode()
                garbage = 0 if frames else garbage
            except InvalidDataError:
                frames, garbage = [], garbage + 1
                self.events.append(events.UNDECODABLE("picture"))
                if garbage > MOST_GARBAGE:
                    raise
            yield from frames
            asked = self._clock()

    def _keep(self, frame: av.VideoFrame) -> None:
        stamp = self._clock()
        if max(frame.width, frame.height) > LARGEST:
            raise ValueError(f"its pictures have {frame.width} x {frame.height} pixels")
        picture = planes(frame.reformat(*self._size, format="yuv420p"))
        if self._newest:
            self.events.append(events.SKIPPED_PICTURE())
        self._newest.append(Shot(picture, stamp, self._clock()))
        self._alive_ns = stamp
        if self._trouble:
            self._trouble = ""
            self.said.append(f"camera: {self._called} gives pictures again")

    def _complain(self, why: str, now: Ns, then: str = f"tried every {RETRY_S:g} s") -> None:
        self.events.append(events.LOST_CAMERA())
        self._alive_ns = now
        if why != self._trouble:
            self._trouble = why
            self.said.append(f"camera: {self._called} gives no pictures: {why}; {then}")


def reason(error: Exception) -> str:
    """An error of FFmpeg in words, without its number and the address."""
    if isinstance(error, ExitError):
        return SILENT
    if isinstance(error, InvalidDataError):
        return "what it gives is no video, or damaged"
    if isinstance(error, OSError) and error.errno == ENOTTY:
        return "it is no camera"
    said = error.strerror if isinstance(error, OSError | FFmpegError) else None
    return without_passwords(" ".join((said or str(error)).split()))[:200]


def planes(frame: av.VideoFrame) -> Picture:
    """Copies of the planes of a frame in the format yuv420p."""
    height, width = frame.height, frame.width
    sizes = (height, width), (height // 2, width // 2), (height // 2, width // 2)
    return Picture(*(_plane(frame, k, *size) for k, size in enumerate(sizes)))


def _plane(frame: av.VideoFrame, k: int, height: int, width: int) -> Bytes:
    plane = frame.planes[k]
    rows = np.frombuffer(bytes(plane), np.uint8).reshape(-1, plane.line_size)
    return rows[:height, :width]
