"""Cameras that others wrote: GStreamer's RTSP server, FFmpeg's RTP and MPEG-TS.

They are skipped where Debian's packages are not installed: ffmpeg, gir1.2-gst-rtsp-server-1.0,
python3-gi, gstreamer1.0-plugins-good, gstreamer1.0-plugins-ugly.
"""

import os
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path

import pytest

pytest.importorskip("av")

import av
from av.video.stream import VideoStream

from messages import events
from services.camera.io.feed import Feed, Shot
from services.marine import time_stripe
from tests.services.camera.rtsp_camera import HEIGHT, HZ, WIDTH, picture
from tests.support.patience import until

SERVER = Path(__file__).with_name("rtsp_camera.py")
PYTHON = "/usr/bin/python3"  # which has GStreamer's bindings
NEEDED = "import gi; gi.require_version('GstRtspServer', '1.0')"
PICTURES = 20
STARVED_NS = 10_000_000_000  # [ns] of a decoder that is too slow: 6 s behind, if it fell behind
# [ns] by which a picture may be older than is said: the camera's own coding and the quickest way,
# here 0.05 to 0.1 s, of which nobody tells; and a busy computer's.
UNTOLD_NS = 1_000_000_000
FFMPEG = ("ffmpeg", "-nostdin", "-loglevel", "error", "-f", "rawvideo",
          "-pix_fmt", "yuv420p", "-s", f"{WIDTH}x{HEIGHT}", "-framerate", str(HZ),
          "-use_wallclock_as_timestamps", "1", "-i", "-",
          "-vsync", "passthrough",
          "-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency",
          "-g", "10")  # fmt: skip
SDP = """v=0
o=- 0 0 IN IP4 127.0.0.1
s=camera
c=IN IP4 127.0.0.1
t=0 0
m=video {port} RTP/AVP 96
a=rtpmap:96 {codec}/90000
"""


def has_gstreamer() -> bool:
    asked = subprocess.run(
        [PYTHON, "-c", NEEDED], capture_output=True, check=False
    ) if Path(PYTHON).exists() else None  # fmt: skip
    return asked is not None and asked.returncode == 0


gstreamer = pytest.mark.skipif(not has_gstreamer(), reason="no GStreamer RTSP server")
ffmpeg = pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg program")


def utc_minus_monotonic() -> int:
    return time.time_ns() - time.monotonic_ns()


class Watched:
    """A feed, its pictures and its sentences."""

    def __init__(self, source: str, feed: type[Feed]) -> None:
        self.said: list[str] = []
        self.shots: list[Shot] = []
        self.feed = feed(source, WIDTH, HEIGHT, time.monotonic_ns, utc_minus_monotonic)
        self.feed.start(lambda: None)

    def until(self, happened: Callable[[], bool]) -> None:
        until(happened, lambda: self.said, self._take)

    def _take(self) -> None:
        if (shot := self.feed.take()) is not None:
            self.shots.append(shot)
        while self.feed.said:
            self.said.append(self.feed.said.popleft())

    def until_pictures(self, number: int = PICTURES) -> None:
        """Wait for so many from now on."""
        self.shots.clear()
        self.until(lambda: len(self.shots) >= number)

    def until_said(self, words: str) -> None:
        self.until(lambda: any(words in line for line in self.said))


@contextmanager
def watched(source: str, feed: type[Feed] = Feed) -> Generator[Watched]:
    found = Watched(source, feed)
    try:
        yield found
    finally:
        found.feed.close()


@contextmanager
def served(port: int = 0) -> Generator[tuple[subprocess.Popen[str], int]]:
    process = subprocess.Popen([PYTHON, str(SERVER), str(port)], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process, int(process.stdout.readline())
    finally:
        process.kill()
        process.communicate()


@contextmanager
def sent(*words: str) -> Generator[None]:
    """FFmpeg sends pictures that are made now."""
    process = subprocess.Popen([*FFMPEG, *words], stdin=subprocess.PIPE)
    pipe = process.stdin
    assert pipe is not None
    ended = threading.Event()

    def film() -> None:
        while not ended.wait(1.0 / HZ):
            try:
                pipe.write(picture(time.monotonic_ns()))
            except BrokenPipeError:
                return

    thread = threading.Thread(target=film)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        process.kill()
        thread.join()
        process.wait()
        with suppress(BrokenPipeError):
            pipe.close()


class Starved(Feed):
    """A processor that decodes two of five pictures in time."""

    _pts: int | None = None  # of the newest picture: its slices may come one by one

    def decoded(self, packet: "av.Packet[VideoStream]") -> "list[av.VideoFrame]":
        if packet.pts is None or packet.pts != self._pts:
            self._pts = packet.pts
            time.sleep(2.5 / HZ)  # a processor that is too slow
        return super().decoded(packet)


def free_port() -> int:
    """Of UDP, even as RTP wants it; the next one is RTP's own too."""
    while True:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
            found.bind(("127.0.0.1", 0))
            if (port := found.getsockname()[1]) % 2 == 0:
                return port


def require_whole(shots: list[Shot]) -> None:
    """Each picture can be read, is newer than the one before and was made before it came."""
    made = [time_stripe.read(shot.picture.y, shot.arrived_ns) for shot in shots]
    assert None not in made, made
    times = [each for each in made if each is not None]
    assert all(before < after for before, after in pairwise(times))
    assert all(at < shot.arrived_ns for at, shot in zip(times, shots, strict=True))


@pytest.mark.slow
@gstreamer
def test_a_camera_that_vanishes_is_one_sentence_and_comes_back() -> None:
    with served() as (server, port), watched(f"rtsp://127.0.0.1:{port}/stream") as seen:
        seen.until_pictures()
        require_whole(seen.shots)
        assert seen.said == []
        server.kill()
        seen.until_said("gives no pictures")
        with served(port):
            seen.until_said("gives pictures again")
            seen.until_pictures()
            require_whole(seen.shots)
    assert len(set(seen.said)) == len(seen.said) <= 3  # it ended, refused, again


@gstreamer
def test_a_stream_of_another_name_is_one_sentence_without_the_password() -> None:
    with served() as (_, port), watched(f"rtsp://me:secret@127.0.0.1:{port}/other") as seen:
        seen.until_said("gives no pictures")
    address = f"rtsp://…@127.0.0.1:{port}/other"
    why = "Server returned 404 Not Found"
    assert seen.said == [f"camera: {address} gives no pictures: {why}; tried every 2 s"]


@ffmpeg
def test_pictures_over_rtp(tmp_path: Path) -> None:
    port = free_port()
    file = tmp_path / "camera.sdp"
    file.write_text(SDP.format(port=port, codec="H264"))
    with watched(str(file)) as seen, sent("-f", "rtp", f"rtp://127.0.0.1:{port}"):
        seen.until_pictures()
    require_whole(seen.shots)


@pytest.mark.slow
@ffmpeg
def test_pictures_over_udp() -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    with watched(url) as seen, sent("-f", "mpegts", f"{url}?pkt_size=1316"):
        seen.until_pictures()
    require_whole(seen.shots)


def require_told(shots: list[Shot], now: int) -> None:
    """No picture is older than it is said to be, nor kept back."""
    for shot in shots:
        made = time_stripe.read(shot.picture.y, shot.arrived_ns)
        assert made is not None
        assert shot.light.at_ns - made < UNTOLD_NS
        assert shot.light.at_ns <= shot.arrived_ns
    assert now - shots[-1].arrived_ns < UNTOLD_NS


@ffmpeg
@pytest.mark.slow
@pytest.mark.parametrize("form", ["udp", "rtp"])
def test_a_starved_decoder_never_makes_a_picture_older_than_is_said(
    form: str, tmp_path: Path
) -> None:
    port = free_port()
    if form == "rtp":
        file = tmp_path / "camera.sdp"
        file.write_text(SDP.format(port=port, codec="H264"))
        source, words = str(file), ("-f", "rtp", f"rtp://127.0.0.1:{port}")
    else:
        source = f"udp://127.0.0.1:{port}"
        words = ("-f", "mpegts", f"{source}?pkt_size=1316")
    with watched(source, Starved) as seen, sent(*words):
        seen.until_pictures(1)
        began = time.monotonic_ns()
        seen.until(lambda: time.monotonic_ns() > began + STARVED_NS)
        many = len(seen.shots)
        seen.until(lambda: len(seen.shots) > many)
        require_told(seen.shots, time.monotonic_ns())
        assert any(shot.light.exact for shot in seen.shots) == (form == "rtp")
    assert seen.said == []
    assert events.SKIPPED_PICTURE() in seen.feed.events


@pytest.mark.slow
def test_a_camera_that_answers_and_sends_nothing_is_one_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        with watched(f"tcp://127.0.0.1:{server.getsockname()[1]}") as seen:
            seen.until_said("no picture has come for 5 s")
        assert len(seen.said) == 1
        assert seen.shots == []


@ffmpeg
def test_a_codec_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    port = free_port()
    file = tmp_path / "camera.sdp"
    file.write_text(SDP.format(port=port, codec="UNHEARD-OF"))
    with watched(str(file)) as seen, sent("-f", "rtp", f"rtp://127.0.0.1:{port}"):
        seen.until_said("cannot decode its pictures")
    assert len(seen.said) == 1


def test_a_camera_that_only_stays_connected_is_said(tmp_path: Path) -> None:
    """Nobody ever writes into this FIFO, and to open it takes for ever."""
    fifo = tmp_path / "camera.h264"
    os.mkfifo(fifo)
    feed = Feed(str(fifo), WIDTH, HEIGHT, time.monotonic_ns)
    feed.start(lambda: None)
    now = time.monotonic_ns()
    feed.look_after(now + 4_000_000_000)
    assert not feed.said
    for seconds in (8, 16, 24):
        feed.look_after(now + seconds * 1_000_000_000)
    (line,) = feed.said
    assert "no picture has come for 5 s" in line
    assert list(feed.events) == [events.LOST_CAMERA()] * 3
    with fifo.open("wb"):  # so that it ends
        feed.close()
