"""A film with the head-up display in it: decoded, drawn upon and encoded anew."""

from fractions import Fraction
from functools import cache
from math import cos, degrees, radians, sin, tan
from typing import BinaryIO

import av
import numpy as np
from av.error import FFmpegError
from av.video.stream import VideoStream

from services.marine import time_stripe
from services.marine.field_of_view import FieldOfView, lookout
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.log.film_file import TICKS, FilmClock
from tools.log.film_scenes import DOT, FilmedPicture, FilmPlace

try:
    from PIL import Image, ImageDraw, ImageFont
except ModuleNotFoundError:
    raise LindyError(
        f"--overlay needs Pillow, which is not installed; {how_to_install('camera')}"
    ) from None

QUALITY = "20"  # of x264: no worse than what was sent
WHITE, BLACK = (255, 255, 255), (0, 0, 0)
MARK_DEG, NAMED_DEG = 5, 15  # [°] of heading between two marks, and between two with a number
TAPE = 0.36  # [-] of the width, to each side
LADDER = (-60, -45, -30, -20, -10, 10, 20, 30, 45, 60)  # [°] above the horizon, as on the page
SMALL = 28.0  # lines of small text would fill the height
LEADING = 1.3  # [-] from line to line, of the font's size
EDGE = 80.0  # [°] what lies further from the axis is not in any picture


class DrawnFilm:
    def __init__(self, file: BinaryIO, first: FilmedPicture, view: FieldOfView | None) -> None:
        """
        Args:
            first: a keyframe, with the parameters of all that follow.
            view: of the camera; None: not known.
        """
        self._view = view
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
            seen = np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)
            time_stripe.paint_over(seen)
            image = Image.fromarray(seen)
            draw(image, picture.drone, self._view)
            drawn = av.VideoFrame.from_ndarray(np.asarray(image), format="rgb24")
            drawn.pts, drawn.time_base = self._clock.ticks(picture.light_ns), Fraction(1, TICKS)
            self._out.mux(self._stream.encode(drawn))
        return bool(frames)

    def close(self) -> None:
        self._out.mux(self._stream.encode(None))
        self._out.close()


@cache  # it is unpacked and read each time
def _font(size: float) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)  # of a size that was asked for
    return font


def _drawable(text: str) -> str:
    return text.replace("–", "-")  # the font has no dash


class Pen:
    """White with a black edge, so that it is read on any picture. Coordinates in px."""

    def __init__(self, image: Image.Image) -> None:
        self._draw, (self.width, self.height) = ImageDraw.Draw(image), image.size
        self._thick = max(1, self.height // 240)

    def line(self, *points: tuple[float, float]) -> None:
        for colour, width in ((BLACK, 3 * self._thick), (WHITE, self._thick)):
            self._draw.line(points, colour, width)

    def write(self, x: float, y: float, text: str, anchor: str, part: float = SMALL) -> None:
        """`part`: as many lines of text would fill the height."""
        text, font, edge = _drawable(text), self._font(part), self._thick
        self._draw.text((x, y), text, WHITE, font, anchor, stroke_width=edge, stroke_fill=BLACK)

    def footer(self, text: str, margin: float) -> float:
        """Parts of a line with dots between them, at the bottom, in as many lines as it needs.
        Returns the y of its top."""
        font, room, lines = self._font(SMALL), self.width - 2.0 * margin, [""]
        for part in text.split(DOT):
            longer = DOT.join(filter(None, (lines[-1], part)))
            if lines[-1] and self._draw.textlength(_drawable(longer), font) > room:
                lines.append(part)
            else:
                lines[-1] = longer
        bottom = self.height - margin
        for number, line in enumerate(reversed(lines)):
            self.write(margin, bottom - number * LEADING * font.size, line, "ls")
        return bottom - (len(lines) * LEADING) * font.size

    def _font(self, part: float) -> ImageFont.FreeTypeFont:
        return _font(max(9.0, self.height / part))


def draw(image: Image.Image, drone: FilmPlace, view: FieldOfView | None) -> None:
    """Horizon, depth, a tape of the heading, and a line with everything else. Horizon and tape fit
    the picture, as on the cockpit's page; of a camera whose view is not known there is none."""
    pen = Pen(image)
    width, height = pen.width, pen.height
    margin = height / 40.0
    footer = pen.footer(drone.words, margin)
    if view is not None:
        _horizon(pen, drone, view, footer)
    depth = "–" if drone.depth is None else f"{drone.depth:.1f} m"
    pen.write(width - margin, height / 2.0, depth, "rm", 14.0)
    if drone.heading is None:
        pen.write(width / 2.0, margin, "–", "mt", 14.0)
        return
    pen.write(width / 2.0, margin, f"{round(drone.heading) % 360:03d}°", "mt", 14.0)
    if view is not None:
        _tape(pen, drone.heading, view, margin + height / 12.0)


def _focal(pen: Pen, view: FieldOfView) -> float:
    """[px]"""
    return pen.width / 2.0 / tan(view.angle / 2.0)


def _tape(pen: Pen, heading: float, view: FieldOfView, top: float) -> None:
    focal, first = _focal(pen, view), round((heading - EDGE) / MARK_DEG) * MARK_DEG
    for mark in range(first, first + 2 * round(EDGE), MARK_DEG):
        aside = focal * tan(radians(max(-EDGE, min(EDGE, mark - heading))))
        if abs(aside) > TAPE * pen.width:
            continue
        x, named = pen.width / 2.0 + aside, mark % NAMED_DEG == 0
        end = top + pen.height / (40.0 if named else 80.0)
        pen.line((x, top), (x, end))
        if named:
            pen.write(x, end + 2.0, f"{mark % 360:03d}", "mt")


def _horizon(pen: Pen, drone: FilmPlace, view: FieldOfView, footer: float) -> None:
    """The ladder of the page: what is drawn at an elevation is seen there in the picture."""
    if drone.roll is None or drone.pitch is None:
        return
    seen, focal = lookout(view, drone.roll, drone.pitch, drone.tilt), _focal(pen, view)
    c, s, unit = cos(seen.roll), sin(seen.roll), pen.height / 28.0

    def at(right: float, below: float) -> tuple[float, float]:
        return pen.width / 2.0 + c * right + s * below, pen.height / 2.0 - s * right + c * below

    for elevation in (0, *LADDER):
        if abs(degrees(seen.elevation) - elevation) >= EDGE:
            continue
        below = seen.below(radians(elevation), focal)
        reach = 0.3 * pen.width if elevation == 0 else 2.2 * unit
        ends = at(-reach, below), at(reach, below)
        lowest = max(y for _, y in ends)
        if not 0.2 * pen.height < lowest < min(0.9 * pen.height, footer):
            continue  # the heading is there, or the words
        pen.line(*ends)
        if elevation:
            pen.write(*at(3.4 * unit, below), str(abs(elevation)), "mm")
    x, y = pen.width / 2.0, pen.height / 2.0  # where the camera looks
    mark = (-3.0, 0.0), (-1.0, 0.0), (0.0, 0.8), (1.0, 0.0), (3.0, 0.0)
    pen.line(*((x + a * unit, y + b * unit) for a, b in mark))
