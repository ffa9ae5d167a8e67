"""A film with the head-up display in it: decoded, drawn upon and encoded anew."""

from fractions import Fraction
from functools import cache
from typing import BinaryIO

import av
import numpy as np
from av.error import FFmpegError
from av.video.stream import VideoStream

from services.marine import time_stripe
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.log.film_file import TICKS, FilmClock
from tools.log.film_scenes import FilmedPicture, FilmPlace

try:
    from PIL import Image, ImageDraw, ImageFont
except ImportError:
    raise LindyError(
        f"--overlay needs Pillow, which is not installed; {how_to_install('camera')}"
    ) from None

QUALITY = "20"  # of x264: no worse than what was sent
Font = ImageFont.FreeTypeFont | ImageFont.ImageFont
WHITE, BLACK = (255, 255, 255), (0, 0, 0)
TAPE_DEG = 90.0  # [°] of heading that its tape shows
MARK_DEG, NAMED_DEG = 10, 30  # [°] between two marks, and between two with a number


class DrawnFilm:
    def __init__(self, file: BinaryIO, first: FilmedPicture) -> None:
        self._out = av.open(file, "w", format="mp4")
        options = {"crf": QUALITY, "preset": "fast"}
        self._stream: VideoStream = self._out.add_stream("libx264", rate=25, options=options)
        self._stream.width, self._stream.height = first.size
        self._stream.pix_fmt = "yuv420p"
        self._stream.codec_context.time_base = Fraction(1, TICKS)
        self._decoder = av.CodecContext.create("h264", "r")
        self._decoder.thread_count = 1  # several would keep pictures back
        self._clock = FilmClock(first.light_ns)

    def add(self, picture: FilmedPicture) -> bool:
        try:
            frames = self._decoder.decode(av.Packet(picture.data))
        except FFmpegError:
            return False
        for frame in frames:
            image = Image.fromarray(frame.to_ndarray(format="rgb24"))
            _clear(image)
            draw(image, picture.drone)
            drawn = av.VideoFrame.from_ndarray(np.asarray(image), format="rgb24")
            drawn.pts, drawn.time_base = self._clock.ticks(picture.light_ns), Fraction(1, TICKS)
            self._out.mux(self._stream.encode(drawn))
        return bool(frames)

    def close(self) -> None:
        self._out.mux(self._stream.encode(None))
        self._out.close()


@cache  # it is unpacked and read each time
def _font(size: float) -> Font:
    return ImageFont.load_default(size)


def _clear(image: Image.Image) -> None:
    """A simulated camera's time stripe is for machines."""
    if time_stripe.read(np.asarray(image.convert("L")), 0) is not None:
        stripe = time_stripe.HEIGHT
        image.paste(image.crop((0, stripe, image.width, 2 * stripe)), (0, 0))


def draw(image: Image.Image, drone: FilmPlace) -> None:
    """Depth, a tape of the heading, and a line with everything else."""
    pen, (width, height) = ImageDraw.Draw(image), image.size
    large, small = (_font(max(9.0, height / n)) for n in (14.0, 28.0))
    margin = height / 40.0

    def write(x: float, y: float, text: str, font: Font, anchor: str) -> None:
        edge = max(1, height // 240)
        pen.text((x, y), text, WHITE, font, anchor, stroke_width=edge, stroke_fill=BLACK)

    write(margin, height - margin, drone.words, small, "ls")
    depth = "–" if drone.depth is None else f"{drone.depth:.1f} m"
    write(width - margin, height / 2.0, depth, large, "rm")
    if drone.heading is None:
        write(width / 2.0, margin, "–", large, "mt")
        return
    heading, top = drone.heading, margin + height / 12.0
    write(width / 2.0, margin, f"{round(heading) % 360:03d}°", large, "mt")
    first = round((heading - TAPE_DEG / 2.0) / MARK_DEG) * MARK_DEG
    for mark in range(first, first + round(TAPE_DEG) + 1, MARK_DEG):
        x = width / 2.0 + (mark - heading) / TAPE_DEG * width * 0.6
        named = mark % NAMED_DEG == 0
        end = top + height / (40.0 if named else 80.0)
        pen.line([(x, top), (x, end)], fill=BLACK, width=max(3, height // 120))
        pen.line([(x, top), (x, end)], fill=WHITE, width=max(1, height // 360))
        if named:
            write(x, end + 2.0, f"{mark % 360:03d}", small, "mt")
