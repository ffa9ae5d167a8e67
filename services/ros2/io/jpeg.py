"""JPEG of a camera's H.264, which is what the viewers of ROS show. Garbage gives no picture and
never raises."""

import io

import av
import numpy as np
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from PIL import Image

from messages.video import AccessUnit
from services.marine import time_stripe

LARGEST = 8192  # [px] of a side of a picture
QUALITY = 80  # of JPEG


class JpegOfVideo:
    """The pictures of one camera, from a keyframe on."""

    def __init__(self) -> None:
        self._codec: VideoCodecContext | None = None

    def take(self, unit: AccessUnit) -> bytes | None:
        """The picture of this access unit; None: there is none."""
        if unit.about.keyframe:
            self._codec = _opened()
        if self._codec is None:
            return None
        try:
            frames = self._codec.decode(av.Packet(unit.data))
        except (FFmpegError, ValueError, MemoryError):
            return None
        if not frames or max(frames[-1].width, frames[-1].height) > LARGEST:
            return None
        seen = np.asarray(frames[-1].to_ndarray(format="rgb24"), np.uint8)
        if unit.about.stripe:
            time_stripe.paint_over(seen)
        data = io.BytesIO()
        Image.fromarray(seen).save(data, "JPEG", quality=QUALITY)
        return data.getvalue()

    def forget(self) -> None:
        """Access units are left out from here on: nothing is decoded before the next keyframe."""
        self._codec = None


def _opened() -> VideoCodecContext:
    codec = av.CodecContext.create("h264", "r")
    assert isinstance(codec, VideoCodecContext)
    codec.thread_count = 1  # several would keep pictures back
    codec.options = {"flags": "low_delay"}
    return codec
