"""`lindy log snapshots`: the pictures that the pilot took, each with where it was taken."""

import sys
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from messages import cameras
from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.choices import named
from tools.exit_status import DONE, LOST
from tools.fresh import write_fresh
from tools.log.film_scenes import Camera, FilmedPicture, chosen, marks, pictures
from tools.packages import require_package
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

LONGEST_S = 1e6  # [s] of a recording


def snapshots(
    recording: Path,
    *,
    out: Annotated[Path, Parameter(converter=named, help="the folder to write into")],
    at: Annotated[
        tuple[float, ...],
        Parameter(consume_multiple=True, help="[s] since the first picture; default: as taken"),
    ] = (),
    camera: Camera = "",
) -> int:
    """The pictures that the pilot took (JPEG).

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
    from tools.log.snapshot_file import jpeg, last_of

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
