"""Pictures from a device, the network or a file, by FFmpeg.

A thread of its own reads and decodes them, and keeps the newest one. A camera that is not there,
vanishes, falls silent or sends garbage is said once and tried again every two seconds.
"""

import struct
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from errno import ENOTTY
from math import inf
from pathlib import Path
from typing import NamedTuple, cast

import av
import numpy as np
from av.codec.context import Flags, Flags2
from av.container import InputContainer
from av.error import ExitError, FFmpegError, InvalidDataError
from av.video.codeccontext import VideoCodecContext
from av.video.reformatter import VideoReformatter
from av.video.stream import VideoStream

from messages import events
from messages.events import Event
from messages.units import Ns
from services.camera.capture_time import BEHIND_NS, LONGEST_WAIT_NS, CaptureTime, Light
from services.camera.core import STALE_NS
from services.camera.sea import Picture
from services.runtime.config.passwords import without_passwords

RETRY_S = 2.0  # [s]
AGAIN_NS = 20_000_000_000  # [ns] what lasts is said again, to who has come since
TIMEOUT_S = 5.0  # [s] without a picture: the camera is silent
SILENT = f"no picture has come for {TIMEOUT_S:g} s"
MOST_GARBAGE = 100  # packets in a row of which nothing can be decoded
# Formats whose time stamps are the sender's. Others have none, and FFmpeg counts pictures instead.
STAMPED = {"rtsp", "sdp", "rtp", "mpegts", "flv", "video4linux2,v4l2"}
V4L2 = "video4linux2,v4l2"  # its stamps are the kernel's, by the monotonic clock, as ours
BY_TCP = "rtspt://"  # RTSP whose pictures come by TCP too, as GStreamer writes it
WALLCLOCK = struct.Struct("<q")  # [µs] UTC, of FFmpeg's AVProducerReferenceTime: a sender report's
FILM_HZ = 25.0  # [1/s] pictures of a film that does not say when each is due
MOST_UNITS = 32  # that the service has not taken: it hangs, and what follows is decoded again
PERIOD_NS = 2_000_000_000  # [ns]
SEQUENCE = b"\0\0\1\x27", b"\0\0\1\x47", b"\0\0\1\x67"  # H.264, 7.3.1: of its parameters
PARAMETERS = 200  # [B] of a keyframe within which they are
LARGEST = 8192  # [px] of a side of a picture that is taken
# What a stream holds is known from its first pictures; how many a second they are is not waited
# for. What was read by then is shown, not thrown away: without its keyframe the rest is garbage.
AT_ONCE = {"fpsprobesize": "0", "analyzeduration": "1000000"}  # [µs]


class Shot(NamedTuple):
    """A picture in memory."""

    picture: Picture
    light: Light
    arrived_ns: Ns  # when it came from the camera
    captured_ns: Ns  # when it was decoded and scaled


class Unit(NamedTuple):
    """A picture as its camera has encoded it."""

    data: bytes  # H.264, Annex B
    keyframe: bool
    light: Light
    arrived_ns: Ns


class Arrived(NamedTuple):
    """Goes along with a packet through the decoder."""

    light: Light
    at_ns: Ns


class Feed:
    """Keeps the newest picture of one source. `events` and `said` are emptied by the service."""

    def __init__(
        self,
        source: str,
        width: int,
        height: int,
        clock: Callable[[], Ns],
        wall_offset_ns: Callable[[], Ns] = lambda: 0,
        called: str = "camera",
    ) -> None:
        """
        Args:
            wall_offset_ns: UTC minus `clock`.
            called: what its sentences call the camera.
        """
        self.events: deque[Event] = deque()
        self.said: deque[str] = deque()  # sentences for the log
        self.size = width, height  # [px] wanted
        self.now = clock
        self._source = source
        self._wall_offset_ns = wall_offset_ns
        self._newest: deque[Shot] = deque(maxlen=1)
        self.passing = False  # the service wants `units` instead of pictures, where there are any
        self.units: deque[Unit] = deque()  # every one, in order; emptied by the service
        self.kbit, self.hz = inf, inf  # [kbit/s], [1/s] of its own H.264; inf: it cannot be passed
        self._scaler = VideoReformatter()
        self._called = f"{called}: {without_passwords(source)}"
        self._trouble, self._told_ns = "", 0
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

    @property
    def stopped(self) -> bool:
        return self._stop.is_set()

    def said_ns(self, packet: "av.Packet[VideoStream]", form: str, own_ns: Ns | None) -> Ns | None:
        """When the light of a packet arrived, as its source says."""
        if form == V4L2:
            return own_ns
        if not packet.has_sidedata("prft"):
            return None
        (utc_us,) = WALLCLOCK.unpack(bytes(packet.get_sidedata("prft"))[: WALLCLOCK.size])
        return utc_us * 1000 - self._wall_offset_ns()

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
                self._complain(why, self.now())
                notify()
                self._stop.wait(RETRY_S)

    def _opened(self) -> InputContainer:
        source, timeout = self._source, (TIMEOUT_S, TIMEOUT_S)
        if source.startswith("/dev/") and not Path(source).is_file():
            return av.open(source, format="v4l2", options=AT_ONCE, timeout=timeout)
        if source.startswith(BY_TCP):
            address, transport = "rtsp://" + source.removeprefix(BY_TCP), {"rtsp_transport": "tcp"}
            return av.open(address, options=AT_ONCE | transport, timeout=timeout)
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
        if Path(self._source).is_file() and not self._source.endswith(".sdp"):
            return self._show(container, stream, notify) > 0
        _Live(self, container, stream, codec, notify).watch()
        return False

    def _show(
        self, container: InputContainer, stream: VideoStream, notify: Callable[[], None]
    ) -> int:
        """A film, at its own pace, to its end. Returns how many pictures there were."""
        began, first, number = self.now(), None, 0
        rate = float(stream.average_rate or FILM_HZ)
        garbage = 0
        for packet in container.demux(stream):
            frames = self.decoded(packet)
            garbage = 0 if frames else garbage + 1
            if garbage > MOST_GARBAGE:
                raise InvalidDataError(0, "")
            for frame in frames:
                number += 1
                time = number / rate if frame.pts is None else frame.time
                first = time if first is None else first  # a film that was cut begins later than 0
                wait = began + round((time - first) * 1e9) - self.now()
                self._stop.wait(min(max(wait / 1e9, 0.001), 1.0))
                if self._stop.is_set():
                    return number
                now = self.now()
                self.keep(frame, Arrived(Light(now, exact=False), now))
                notify()
        return number

    def decoded(self, packet: "av.Packet[VideoStream]") -> list[av.VideoFrame]:
        """What is in it. A packet that was damaged on its way is no reason to connect anew."""
        try:
            return packet.decode()
        except InvalidDataError:
            self.events.append(events.UNDECODABLE("picture"))
            return []

    def keep(self, frame: av.VideoFrame, arrived: Arrived) -> None:
        """
        Raises:
            ValueError: it is too large, or of a format that cannot be converted.
        """
        if max(frame.width, frame.height) > LARGEST:
            raise ValueError(f"its pictures have {frame.width} x {frame.height} pixels")
        picture = planes(self._scaler.reformat(frame, *self.size, format="yuv420p"))
        if self._newest:
            self.events.append(events.SKIPPED_PICTURE())
        now = self.now()
        self._newest.append(Shot(picture, arrived.light, arrived.at_ns, now))
        self._alive(now)

    def pass_on(self, unit: Unit) -> None:
        self.units.append(unit)
        self._alive(self.now())

    def _alive(self, now: Ns) -> None:
        self._alive_ns = now
        if self._trouble:
            self._trouble = ""
            self.said.append(f"{self._called} gives pictures again")

    def _complain(self, why: str, now: Ns, then: str = f"tried every {RETRY_S:g} s") -> None:
        self.events.append(events.LOST_CAMERA())
        self._alive_ns = now
        if why != self._trouble or now > self._told_ns + AGAIN_NS:
            self._trouble, self._told_ns = why, now
            self.said.append(f"{self._called} gives no pictures: {why}; {then}")


class _Live:
    """A source whose pictures come when they come, from its opening to its end."""

    def __init__(
        self,
        feed: Feed,
        container: InputContainer,
        stream: VideoStream,
        codec: VideoCodecContext,
        notify: Callable[[], None],
    ) -> None:
        self._feed, self._container, self._stream, self._notify = feed, container, stream, notify
        codec.flags |= Flags.copy_opaque  # a picture has the arrival of its packet
        self._decoded_ns = feed.now()  # [ns] when something was decoded last
        self._codec = codec
        self._passing = False
        self._undecoded: list[av.Packet[VideoStream]] = []  # passed on, since the last keyframe
        self._split = False  # slices of one picture come as packets of their own
        self._counted = ArrivalRates(feed.now())

    def watch(self) -> None:
        """Read, until it ends.

        Raises:
            ValueError: it has fallen silent, or behind, or nothing of it can be decoded.
        """
        feed, form, behind = self._feed, self._container.format.name, False
        capture, asked, own_before, key_before = CaptureTime(), feed.now(), None, False
        for packet in self._container.demux(self._stream):
            now = feed.now()
            # A wait that timed out first gives what was kept back: an old picture.
            if now > asked + round(TIMEOUT_S * 1e9):
                raise ValueError(SILENT)
            if feed.stopped:
                return
            own = None if packet.pts is None else round(packet.pts * packet.time_base * 10**9)
            stamped = own if form in STAMPED else None
            light = capture.light(stamped, feed.said_ns(packet, form, stamped), now)
            if stamped is not None and not light.exact and now > light.at_ns + BEHIND_NS:
                late = (now - light.at_ns) / 1e9
                raise ValueError(f"its pictures come {late:.1f} s later than at first")
            packet.opaque = Arrived(light, now)
            # Slices of one keyframe come as packets of one time; the first ones may lack it.
            same = own is not None and own == own_before
            same = same or (key_before and (own is None) != (own_before is None))
            self._split = self._split or same
            own_before, key_before = own, packet.is_keyframe
            # Whoever is so far behind goes on with the next keyframe.
            begins = packet.is_keyframe and not same
            behind = not begins and (behind or now > light.at_ns + LONGEST_WAIT_NS)
            if behind:
                feed.events.append(events.SKIPPED_PICTURE())
            elif not self._pass(packet):
                self._decode(packet)
            asked = feed.now()
            if asked > self._decoded_ns + round(TIMEOUT_S * 1e9):
                raise ValueError(f"nothing of it could be decoded for {TIMEOUT_S:g} s")

    def _decode(self, packet: "av.Packet[VideoStream]") -> None:
        for frame in self._feed.decoded(packet):
            self._decoded_ns = now = self._feed.now()
            arrived = cast(Arrived, frame.opaque)
            if now > arrived.at_ns + STALE_NS:
                self._feed.events.append(events.SKIPPED_PICTURE())
                continue
            self._feed.keep(frame, arrived)
            self._notify()

    def _pass(self, packet: "av.Packet[VideoStream]") -> bool:
        """Hand a packet on as it came: from a keyframe on, for as long as the service wants it. If
        it does not any more, the decoder is shown what it has missed."""
        feed, data = self._feed, bytes(packet)
        if packet.is_keyframe and not has_parameters(data):
            data = bytes(self._codec.extradata or b"") + data
        fits = not self._split and can_be_passed(self._codec, feed.size)
        fits = fits and (not packet.is_keyframe or has_parameters(data))
        feed.kbit, feed.hz = self._counted.rates(len(data), feed.now()) if fits else (inf, inf)
        wanted = feed.passing and fits and len(feed.units) < MOST_UNITS
        self._passing = wanted and (self._passing or packet.is_keyframe)
        missed = [] if packet.is_keyframe else self._undecoded
        if not self._passing:
            self._undecoded = []
            for each in missed:
                feed.decoded(each)
            return False
        self._undecoded = [*missed, packet]
        arrived = cast(Arrived, packet.opaque)
        self._decoded_ns = feed.now()
        feed.pass_on(Unit(data, bool(packet.is_keyframe), arrived.light, arrived.at_ns))
        self._notify()
        return True


@dataclass(slots=True)
class ArrivalRates:
    """How much comes, over the last whole period of `PERIOD_NS`."""

    _since: Ns
    _bytes: int = 0
    _units: int = 0
    _rates: tuple[float, float] = (inf, inf)  # [kbit/s], [1/s]; inf: not known yet

    def rates(self, size: int, now: Ns) -> tuple[float, float]:
        """With a packet of this size [B]."""
        self._bytes, self._units = self._bytes + size, self._units + 1
        if (passed := now - self._since) >= PERIOD_NS:
            self._rates = self._bytes * 8e6 / passed, self._units * 1e9 / passed
            self._since, self._bytes, self._units = now, 0, 0
        return self._rates


def can_be_passed(codec: VideoCodecContext, size: tuple[int, int]) -> bool:
    """Is it what our own encoder would give: of this size, each picture decodable at once?"""
    same = codec.name == "h264" and (codec.width, codec.height) == size
    return same and codec.pix_fmt in ("yuv420p", "yuvj420p") and not codec.has_b_frames


def has_parameters(data: bytes) -> bool:
    """Does a keyframe in Annex B form begin with its sequence's parameters?"""
    return any(start in data[:PARAMETERS] for start in SEQUENCE)


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
    stacked = np.asarray(frame.to_ndarray(), np.uint8).ravel()
    y, u, v = np.split(stacked, [height * width, height * width * 5 // 4])
    half = height // 2, width // 2
    return Picture(y.reshape(height, width), u.reshape(half), v.reshape(half))
