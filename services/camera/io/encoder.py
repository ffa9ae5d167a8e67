"""H.264 by x264, through PyAV: each picture at once, none refers to a later one."""

from fractions import Fraction
from typing import cast

import av
import numpy as np
from av.codec import Codec
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType

from services.camera.core import Order
from services.camera.sea import Picture
from services.runtime.config.errors import LindyError

TICKS = 1000  # [1/s] of the encoder's time stamps: pictures may be left out
BUFFER_S = 0.25  # [s] of the bitrate that one picture may take at most …
BUFFER_PICTURES = 3.0  # … or so many pictures of average size, whichever is more
# [bit] of a pixel: with so many the fastest preset cannot be told from the next one, which takes
# twice the time and is worth 1.8 dB where there are fewer.
PLENTY = 0.2
NEVER = 1 << 20  # pictures between two keyframes: they are asked for


class VideoEncoder:
    """One size, one bitrate at a time."""

    def __init__(self, width: int, height: int) -> None:
        """
        Raises:
            LindyError: this FFmpeg cannot encode H.264.
        """
        self._width, self._height = width, height
        self._codec: VideoCodecContext | None = None
        self._kbit = 0.0
        self._began_ns = 0
        try:
            Codec("libx264", "w")
        except ValueError:
            raise LindyError(
                "camera: the installed PyAV has no H.264 encoder (libx264); the wheels of PyPI do"
            ) from None

    def encode(self, picture: Picture, stamp_ns: int, order: Order) -> bytes:
        """The access unit of a picture, Annex B. Another bitrate than before begins anew, with a
        keyframe."""
        if self._codec is None or order.kbit != self._kbit:
            self._codec = self._opened(order.kbit, order.hz)
            self._kbit, self._began_ns = order.kbit, stamp_ns
        # Under each other, and each plane in rows of the picture's width.
        stacked = np.concatenate([plane.ravel() for plane in picture])
        frame = av.VideoFrame.from_ndarray(stacked.reshape(-1, self._width), "yuv420p")
        frame.pts = max(0, stamp_ns - self._began_ns) * TICKS // 1_000_000_000
        frame.time_base = Fraction(1, TICKS)
        if order.keyframe:
            frame.pict_type = PictureType.I
        packets = cast(list[memoryview], self._codec.encode(frame))
        return b"".join(map(bytes, packets))

    def _opened(self, kbit: float, hz: float) -> VideoCodecContext:
        codec = av.CodecContext.create("libx264", "w")
        assert isinstance(codec, VideoCodecContext)
        codec.width, codec.height, codec.pix_fmt = self._width, self._height, "yuv420p"
        codec.time_base = Fraction(1, TICKS)
        codec.framerate = Fraction(round(hz * 100), 100)
        codec.bit_rate = round(kbit * 1000)
        codec.thread_count = 1
        codec.max_b_frames = 0
        codec.gop_size = NEVER
        plenty = 1e3 * kbit > PLENTY * hz * self._width * self._height
        buffer_s = max(BUFFER_S, BUFFER_PICTURES / hz)
        codec.options = {
            "preset": "ultrafast" if plenty else "superfast",
            "tune": "zerolatency",
            "forced-idr": "1",
            "maxrate": str(round(kbit * 1000)),
            "bufsize": str(round(kbit * 1000 * buffer_s)),
            "x264-params": "scenecut=0:repeat-headers=1:annexb=1",
        }
        codec.open()
        return codec
