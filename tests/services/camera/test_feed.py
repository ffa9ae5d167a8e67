"""A camera that is not there, ends or sends garbage is one sentence, and no more."""

import socket
import threading
import time
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import cast

import numpy as np
import pytest

pytest.importorskip("av")

import av
from av.video.codeccontext import VideoCodecContext
from av.video.stream import VideoStream

from messages import events
from services.camera.capture_time import Light
from services.camera.io.feed import Arrived, Feed, Shot
from tests.support.patience import PATIENCE_S


class Watched:
    """A feed and what it says."""

    def __init__(self, source: str) -> None:
        self.feed = Feed(source, 160, 90, time.monotonic_ns)
        self.noticed = threading.Event()
        self.feed.start(self.noticed.set)

    def wait(self) -> None:
        assert self.noticed.wait(PATIENCE_S)
        self.noticed.clear()

    def shots(self, number: int) -> list[Shot]:
        """The next ones; then it is closed."""
        found = list[Shot]()
        while len(found) < number:
            self.wait()
            if (shot := self.feed.take()) is not None:
                found.append(shot)
        self.feed.close()
        return found


@pytest.mark.parametrize(
    "source", ["/dev/video97", "/nowhere/film.mp4", "rtsp://me:secret@127.0.0.1:9/x", "garbage"]
)
def test_a_camera_that_is_not_there_is_one_sentence(source: str, tmp_path: Path) -> None:
    if source == "garbage":
        source = str(tmp_path / "film.mp4")
        Path(source).write_bytes(np.random.default_rng(1).bytes(30_000))
    watched = Watched(source)
    watched.wait()
    watched.feed.close()
    assert watched.feed.take() is None
    assert len(watched.feed.said) == 1
    assert "gives no pictures" in watched.feed.said[0]
    assert "secret" not in watched.feed.said[0]
    assert list(watched.feed.events) == [events.LOST_CAMERA()]


SDP = (
    "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=camera\r\nt=0 0\r\nm=video 0 RTP/AVP 96\r\n"
    "a=rtpmap:96 H264/90000\r\na=control:track0\r\n"
)


def transport_asked_of(server: socket.socket) -> str:
    """Answers as an RTSP server does, until the client asks for its pictures: by which way."""
    connection, _ = server.accept()
    with connection, connection.makefile("r", newline="\r\n") as lines:
        while request := lines.readline():
            headers = dict(
                line.strip().lower().split(": ", 1) for line in iter(lines.readline, "\r\n")
            )
            if request.startswith("SETUP"):
                return headers["transport"].split(";")[0]
            body = SDP if request.startswith("DESCRIBE") else ""
            head = (
                f"RTSP/1.0 200 OK\r\nCSeq: {headers['cseq']}\r\nContent-Type: application/sdp\r\n"
            )
            connection.sendall(f"{head}Content-Length: {len(body)}\r\n\r\n{body}".encode())
    return ""


@pytest.mark.parametrize(
    ("scheme", "transport"), [("rtsp", "rtp/avp/udp"), ("rtspt", "rtp/avp/tcp")]
)
def test_the_way_of_rtsp_pictures_can_be_chosen(scheme: str, transport: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE_S)
        watched = Watched(f"{scheme}://127.0.0.1:{server.getsockname()[1]}/stream")
        assert transport_asked_of(server) == transport
        watched.feed.close()


Size = tuple[int, int]  # [px] width and height


def film(
    path: Path,
    levels: Iterable[int],
    size: tuple[int, int] = (160, 90),
    hz: int = 25,
    begin: int = 0,
) -> Path:
    """Pictures of these greys, the first at `begin` [s]."""
    width, height = size
    with av.open(str(path), "w", options={"output_ts_offset": str(begin)}) as written:
        stream = written.add_stream("libx264", rate=Fraction(hz), options={"tune": "zerolatency"})
        assert isinstance(stream, VideoStream)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for level in levels:
            grey = np.full((height * 3 // 2, width), level, np.uint8)
            written.mux(stream.encode(av.VideoFrame.from_ndarray(grey, "yuv420p")))
        written.mux(stream.encode(None))
    return path


def test_a_film_of_another_size_is_scaled_and_repeated(tmp_path: Path) -> None:
    watched = Watched(str(film(tmp_path / "film.mp4", (40, 80, 120), (322, 242), 50)))
    shots = watched.shots(7)  # more than the film has
    for shot in shots:
        assert [plane.shape for plane in shot.picture] == [(90, 160), (45, 80), (45, 80)]
        assert shot.arrived_ns <= shot.captured_ns
    assert {round(float(shot.picture.y.mean()) / 40.0) for shot in shots} == {1, 2, 3}
    assert not watched.feed.said


@pytest.mark.parametrize(
    ("name", "begin"), [("film.mp4", 0), ("film.ts", 3600), ("film.h264", 0)],
    ids=["from_zero", "from_an_hour_on", "without_times"],
)  # fmt: skip
def test_a_film_is_shown_at_its_own_pace_wherever_its_times_begin(
    tmp_path: Path, name: str, begin: int
) -> None:
    pictures = 25
    watched = Watched(str(film(tmp_path / name, range(40, 40 + pictures), begin=begin)))
    shots = watched.shots(pictures)
    # Compared with the film's own length: a busy computer makes it longer, never much shorter.
    took = (shots[-1].arrived_ns - shots[0].arrived_ns) / 1e9
    assert 0.8 * (pictures - 1) / 25 < took < 8.0 * (pictures - 1) / 25
    assert list(watched.feed.said) == []


@pytest.mark.parametrize("name", ["libx264", "mjpeg"])
def test_a_damaged_picture_is_left_out_and_the_camera_is_kept(tmp_path: Path, name: str) -> None:
    codec = av.CodecContext.create(name, "w")
    assert isinstance(codec, VideoCodecContext)
    codec.width, codec.height, codec.time_base, codec.gop_size = 160, 90, Fraction(1, 50), 1
    codec.pix_fmt = "yuv420p" if name == "libx264" else "yuvj420p"
    codec.options = {"tune": "zerolatency"} if name == "libx264" else {}
    pictures = list[bytes]()
    for _ in range(12):
        frame = av.VideoFrame.from_ndarray(np.full((135, 160), 90, np.uint8), codec.pix_fmt)
        pictures += map(bytes, cast(list[memoryview], codec.encode(frame)))
    pictures[5] = pictures[5][: len(pictures[5]) // 4] + b"\xff\xff\xff" * 4
    path = tmp_path / ("film.h264" if name == "libx264" else "film.mjpeg")
    path.write_bytes(b"".join(pictures))
    watched = Watched(str(path))
    watched.shots(9)
    assert not watched.feed.said
    assert events.LOST_CAMERA() not in watched.feed.events


@pytest.mark.parametrize(
    ("form", "size", "value", "luma"),
    [
        ("yuv420p", (160, 90), 126, 126),
        ("yuv422p", (322, 242), 126, 126),
        ("yuvj420p", (640, 360), 128, 126),  # of full range: 128 of 255 is 126 of 16 … 235
        ("gray", (640, 480), 128, 126),
        ("yuv420p10le", (3840, 2160), 126 * 4, 126),
        ("rgb24", (160, 90), 128, 126),
    ],
)
def test_pictures_of_other_formats_and_sizes_are_converted(
    form: str, size: tuple[int, int], value: int, luma: int
) -> None:
    """Of one camera one after another, as one that changes them in mid-dive."""
    feed = Feed("none", 160, 90, time.monotonic_ns)
    for each, of, level in (("yuv420p", (640, 360), 60), (form, size, value)):
        frame = av.VideoFrame(*of, each)
        for number, plane in enumerate(frame.planes):
            deep = each.endswith("le")
            kind = np.dtype("<u2" if deep else np.uint8)
            colour = 512 if deep else 128  # none
            shade = colour if number and "rgb" not in each else level
            plane.update(np.full(plane.buffer_size // kind.itemsize, shade, kind).tobytes())
        feed.keep(frame, Arrived(Light(0, exact=False), 0))
    shot = feed.take()
    assert shot is not None
    assert [plane.shape for plane in shot.picture] == [(90, 160), (45, 80), (45, 80)]
    assert abs(float(shot.picture.y.mean()) - luma) < 2.0
    assert abs(float(shot.picture.u.mean()) - 128.0) < 2.0


def test_what_lasts_is_said_again_to_who_has_come_since() -> None:
    feed, S = Feed("/dev/none", 160, 90, lambda: 0), 1_000_000_000
    lines = list[int]()
    for now in range(8 * S, 80 * S, S):
        feed.look_after(now)
        lines.append(len(feed.said))
    assert lines[0] == 1
    assert 3 <= lines[-1] <= 5  # in 72 s: once each 20 s or a little later
