"""H.264 decoded at once, through PyAV. Garbage is refused and never raises."""

import av
import numpy as np
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from numpy.typing import NDArray

LARGEST = 8192  # [px] of a side of a picture


class VideoDecoder:
    def __init__(self) -> None:
        self._codec = _opened()

    def luma(self, data: bytes, *, keyframe: bool) -> NDArray[np.uint8] | None:
        """The luma of the picture of an access unit, shape (height, width); None: there is none.

        Args:
            keyframe: nothing before it is needed, so decoding begins anew.
        """
        if keyframe:
            self._codec = _opened()
        try:
            frames = self._codec.decode(av.Packet(data))
        except (FFmpegError, ValueError, MemoryError):
            return None
        if not frames or max(frames[-1].width, frames[-1].height) > LARGEST:
            return None
        frame = frames[-1]
        plane = frame.planes[0]
        rows = np.frombuffer(bytes(plane), np.uint8).reshape(-1, plane.line_size)
        return rows[: frame.height, : frame.width]


def _opened() -> VideoCodecContext:
    codec = av.CodecContext.create("h264", "r")
    assert isinstance(codec, VideoCodecContext)
    codec.thread_count = 1  # several would keep pictures back
    codec.options = {"flags": "low_delay"}
    return codec
