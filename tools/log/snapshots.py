"""`lindy log snapshots`: the pictures that the pilot took, each with where it was taken."""

import io
import sys
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter

from messages import cameras
from messages.text import harmless
from services.marine import time_stripe
from services.runtime.config.errors import LindyError
from tools.choices import named
from tools.exit_status import DONE, LOST
from tools.fresh import write_fresh
from tools.log.film import Camera, FilmedPicture, FilmPlace, chosen, marks, pictures
from tools.packages import require_package
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

if TYPE_CHECKING:
    from PIL import Image

LONGEST_S = 1e6  # [s] of a recording
QUALITY = 92  # of JPEG
BELOW_SEA = b"\x01"  # of GPSAltitudeRef
TEMPERATURE = 0x9400  # [°C] of what surrounds the camera: EXIF 2.31, which Pillow has no name for
ASCII = b"ASCII\0\0\0"  # of UserComment


def snapshots(
    recording: Path,
    /,
    *,
    out: Annotated[Path, Parameter(converter=named, help="the folder to write into")],
    at: Annotated[
        tuple[float, ...],
        Parameter(consume_multiple=True, help="[s] since the first picture; default: as taken"),
    ] = (),
    camera: Camera = "",
) -> int:
    """Write the pictures that the pilot took (JPEG).

    RECORDING is a dive's folder or its MCAP file. Each file is named by its time (UTC) and carries
    time, depth, heading and place in its EXIF fields. Of several cameras it is the one that was
    large when the pilot took it. Exit status 3: the recording is damaged or was not finished.

    Example: lindy log snapshots dives/latest --out pictures
             lindy log snapshots dives/latest --at 12.5 60 --out pictures
    """
    opened = open_recording(recording)
    with reading("reading", 2 * opened.size) as opened.advance:
        written = taken(opened, out, at, camera)
    print(harmless("\n".join([*map(str, written), *opened.damage])), flush=True)
    return LOST if opened.damage else DONE


def taken(
    recording: Recording, out: Path, at: tuple[float, ...] = (), camera: str = ""
) -> list[Path]:
    """Write the files. Returns their paths.

    Raises:
        LindyError: there are none, or one exists or cannot be written.
    """
    for package in ("av", "PIL"):
        require_package(package, "camera", "a snapshot")
    for each in at:
        if not 0.0 <= each <= LONGEST_S:
            raise LindyError(f"--at {each:g}: expected seconds from 0 to {LONGEST_S:g}")
    there = chosen(recording, camera or cameras.ALL)
    wanted = {
        name: [light for kind, light in marks(recording, name) if kind == "snapshot"]
        for name in there
    }
    if at:
        names = there if camera else there[:1]
        wanted = {name: _times(recording, name, at) for name in names}
    if not any(wanted.values()):
        raise LindyError(f"{recording.files[0]} holds no snapshots; --at SECONDS takes one anyway")
    written = list[Path]()
    for name, times in wanted.items():
        for group in _each(recording, name, sorted(times)):
            image = last_of([picture.data for picture in group])
            shot = group[-1]
            if image is None:
                print(f"the picture of {shot.drone.utc:%H:%M:%S} is damaged", file=sys.stderr)
                continue
            ms = shot.light_ns // 1_000_000 % 1000
            whose = f"-{name}" if len(there) > 1 or name != cameras.FIRST else ""
            path = out / f"{shot.drone.utc:%Y-%m-%dT%H-%M-%S}.{ms:03d}Z{whose}.jpg"
            out.mkdir(parents=True, exist_ok=True)
            write_fresh(path, jpeg(image, shot.drone))
            written.append(path)
    if not written:
        raise LindyError(f"{recording.files[0]} holds no picture at that time")
    return written


def _times(recording: Recording, camera: str, at: tuple[float, ...]) -> list[int]:
    """[ns] UTC of seconds since the first picture."""
    first = next(pictures(recording, camera=camera), None)
    return [] if first is None else [first.light_ns + round(1e9 * each) for each in at]


def _each(recording: Recording, camera: str, wanted: list[int]) -> Iterator[list[FilmedPicture]]:
    """For each time the newest picture by then, behind all that it builds on."""
    group, done = list[FilmedPicture](), 0
    for picture in pictures(recording, camera=camera):
        due = bisect_right(wanted, picture.light_ns - 1)
        if due > done and group:
            yield group
        done = max(done, due)
        if picture.keyframe:
            group = []
        group.append(picture)
    if done < len(wanted) and group:
        yield group


def last_of(units: Sequence[bytes]) -> "Image.Image | None":
    """The last of some access units, the first of which is a keyframe, without a time stripe; None:
    it is damaged."""
    import av
    from av.error import FFmpegError
    from PIL import Image

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


def jpeg(image: "Image.Image", drone: FilmPlace) -> bytes:
    """With time, depth, heading and place. What is not known is left out."""
    from PIL import Image
    from PIL.ExifTags import GPS, IFD, Base

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
