"""An MP4 of pictures that were sent, through PyAV: copied, not coded anew."""

import io
from fractions import Fraction
from typing import BinaryIO

import av

from tools.log.film_scenes import FilmedPicture

TICKS = 90_000  # [1/s] of a film's time stamps, as editors expect


class FilmClock:
    """Times of pictures since the first, each later than the one before."""

    def __init__(self, began_ns: int) -> None:
        self._began, self._last = began_ns, -1

    def ticks(self, at_ns: int) -> int:
        self._last = max(self._last + 1, (at_ns - self._began) * TICKS // 1_000_000_000)
        return self._last


class CopiedFilm:
    def __init__(self, file: BinaryIO, first: FilmedPicture) -> None:
        """
        Args:
            first: a keyframe, with the parameters of all that follow.
        """
        self._out = av.open(file, "w", format="mp4")
        with av.open(io.BytesIO(first.data), format="h264") as raw:
            template = raw.streams.video[0]
            self._stream = self._out.add_stream_from_template(template)
        self._stream.time_base = Fraction(1, TICKS)
        self._clock = FilmClock(first.light_ns)

    def add(self, picture: FilmedPicture) -> bool:
        packet = av.Packet(picture.data)
        packet.stream = self._stream
        packet.time_base = Fraction(1, TICKS)
        packet.pts = packet.dts = self._clock.ticks(picture.light_ns)
        packet.is_keyframe = picture.keyframe
        self._out.mux_one(packet)
        return True

    def close(self) -> None:
        self._out.close()
