"""A picture as a JPEG file with EXIF fields, through PyAV and Pillow."""

import io
from collections.abc import Sequence

import av
import numpy as np
from av.error import FFmpegError
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base

from services.marine import time_stripe
from tools.log.film_scenes import FilmPlace

QUALITY = 92  # of JPEG
BELOW_SEA = b"\x01"  # of GPSAltitudeRef
TEMPERATURE = 0x9400  # [°C] of what surrounds the camera: EXIF 2.31, which Pillow has no name for
ASCII = b"ASCII\0\0\0"  # of UserComment


def last_of(units: Sequence[bytes]) -> Image.Image | None:
    """The last of some access units, the first of which is a keyframe, without a time stripe; None:
    it is damaged."""
    codec, last = av.CodecContext.create("h264", "r"), None
    codec.thread_count = 1  # several would keep pictures back
    for data in units:
        try:
            last = next(iter(codec.decode(av.Packet(data))), None)
        except FFmpegError:
            last = None
    if last is None:
        return None
    seen = np.asarray(last.to_ndarray(format="rgb24"), np.uint8)
    time_stripe.paint_over(seen)
    return Image.fromarray(seen)


def jpeg(image: Image.Image, drone: FilmPlace) -> bytes:
    """With time, depth, heading and place. What is not known is left out."""
    exif = Image.Exif()
    exif[Base.ImageDescription] = (
        drone.words.replace(" · ", ", ").replace(" °C", " C").replace("°", " deg").replace("–", "-")
    )
    exif[Base.Software] = "Lindy"
    time = f"{drone.utc:%Y:%m:%d %H:%M:%S}"
    exif[Base.DateTime] = time
    more = exif.get_ifd(IFD.Exif)
    more[Base.DateTimeOriginal] = time
    more[Base.SubsecTimeOriginal] = f"{drone.at_ns // 1_000_000 % 1000:03d}"
    more[Base.OffsetTimeOriginal] = "+00:00"
    if drone.north is not None and drone.east is not None:
        place = f"north {drone.north:.2f} m, east {drone.east:.2f} m"
        more[Base.UserComment] = ASCII + place.encode()
    if drone.water is not None:
        more[TEMPERATURE] = round(drone.water, 1)
    gps = exif.get_ifd(IFD.GPSInfo)
    if drone.depth is not None:
        gps[GPS.GPSAltitudeRef] = BELOW_SEA
        gps[GPS.GPSAltitude] = round(max(0.0, drone.depth), 2)
    if drone.heading is not None:
        gps[GPS.GPSImgDirectionRef] = "M"
        gps[GPS.GPSImgDirection] = round(drone.heading, 1)
    data = io.BytesIO()
    image.save(data, "JPEG", quality=QUALITY, exif=exif)
    return data.getvalue()
