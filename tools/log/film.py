"""`lindy log film`: the pictures of a recording as a film that any player and editor opens, with
subtitles in the SubRip format (.srt): what the pilot saw beside the picture. Pictures are copied
through PyAV, not coded anew."""

import io
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import chain, groupby
from math import inf
from pathlib import Path
from typing import Annotated, BinaryIO

from cyclopts import Parameter

from messages import cameras
from messages.text import harmless
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from tools.choices import NewFile
from tools.exit_status import DONE, LOST
from tools.fresh import EXISTS, refuse_existing, write_fresh
from tools.log.film_scenes import Camera, FilmedPicture, chosen, filmed_spans, pictures, within
from tools.packages import require_package
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

STEP_NS = 500_000_000  # [ns] between two lines of the subtitles at most
LAST_NS = 500_000_000  # [ns] that the last one is shown
TICKS = 90_000  # [1/s] of a film's time stamps, as editors expect
Spans = Sequence[tuple[int, float]]  # [ns] UTC from when to when


def film(
    recording: Path,
    *,
    out: NewFile,
    marked: Annotated[
        bool, Parameter(negative=(), help="only what the pilot filmed, a film for each")
    ] = False,
    camera: Camera = "",
) -> int:
    """The pictures as a film with subtitles (MP4).

    RECORDING is a dive's folder or its MCAP file. Pictures are copied as they were sent, each at
    the time of its light; OUT's name with .srt has time, depth, heading, place and flight mode. A
    camera that changes its size begins another film, OUT-2. Of several cameras it is the one that
    was large for the longest; with --camera all each has a film, OUT-front, OUT-down. Exit status
    3: the recording is damaged or was not finished.

    Example: lindy log film dives/latest --out dive.mp4
             lindy log film dives/latest --camera all --out dive.mp4
    """
    if out.suffix != ".mp4":
        raise LindyError(f"--out {out}: expected a name that ends in .mp4")
    opened = open_recording(recording)
    with reading("filming", opened.size) as opened.advance:
        made = filmed(opened, out, marked=marked, camera=camera)
    print(harmless("\n".join([*made, *opened.damage])), flush=True)
    return LOST if opened.damage else DONE


def filmed(recording: Recording, out: Path, *, marked: bool = False, camera: str = "") -> list[str]:
    """Write the films. Returns a sentence for each.

    Raises:
        LindyError: there are no pictures, or a file exists or cannot be written.
    """
    names = chosen(recording, camera)
    spans: dict[str, Spans] = {name: [(0, inf)] for name in names}
    if marked:  # with whichever camera was large then
        spans = {name: filmed_spans(recording, name) for name in names}
        names = [name for name in names if spans[name]]
    elif not camera:
        names = names[:1]
    if not names:
        raise LindyError(
            f"{recording.files[0]}: the pilot filmed nothing with {' or '.join(spans)}; leave "
            f"out --marked"
        )
    alone = len(names) == 1 and camera != cameras.ALL
    paths = {n: out if alone else out.with_name(f"{out.stem}-{n}.mp4") for n in names}
    for path in paths.values():
        refuse_existing(path)
    said = [_filmed(recording, n, path, spans[n]) for n, path in paths.items()]
    return [sentence for each in said for sentence in each]


def _filmed(recording: Recording, camera: str, out: Path, spans: Spans) -> list[str]:
    """The films of one camera: one for each span, and for each size."""
    require_package("av", "camera", "a film")
    said, left_out = list[str](), set[int]()
    scenes = within(pictures(recording, left_out, camera), spans)
    films = groupby(scenes, key=lambda each: (each[0], each[1].size))
    for number, (_, shown) in enumerate(films, start=1):
        path = out if number == 1 else out.with_name(f"{out.stem}-{number}.mp4")
        said.append(_written(path, (picture for _, picture in shown)))
    if not said:
        raise LindyError(f"{recording.files[0]} holds no pictures")
    if left_out:
        said.append(
            f"{len(left_out)} pictures of the recording are left out: parts of them, or of those "
            f"that they build on, are missing"
        )
    return said


def _written(path: Path, shown: Iterator[FilmedPicture]) -> str:
    """One film and its subtitles, whole or not at all. Returns what it is."""
    subtitles, count = Subtitles(), 0
    picture = first = next(shown)
    refuse_existing(srt := path.with_suffix(".srt"))
    try:
        file = path.open("xb")
        try:
            with file:
                film = CopiedFilm(file, first)
                for picture in chain([first], shown):
                    film.add(picture)
                    count += 1
                    subtitles.add(max(0, picture.light_ns - first.light_ns), picture.drone.words)
                film.close()
        except BaseException:
            path.unlink()
            raise
    except FileExistsError:
        raise LindyError(f"cannot write {path}: {EXISTS.format('--out')}") from None
    except OSError as error:
        raise LindyError(f"cannot write {path}: {reason(error)}") from None
    write_fresh(srt, subtitles.text().encode())
    seconds = (picture.light_ns - first.light_ns) / 1e9
    return f"{count} pictures, {seconds:.1f} s, in {path} and {srt}"


class CopiedFilm:
    """An MP4 that is being written."""

    def __init__(self, file: BinaryIO, first: FilmedPicture) -> None:
        """
        Args:
            first: a keyframe, with the parameters of all that follow.
        """
        import av

        self._packet = av.Packet
        self._out = av.open(file, "w", format="mp4")
        with av.open(io.BytesIO(first.data), format="h264") as raw:
            self._stream = self._out.add_stream_from_template(raw.streams.video[0])
        self._stream.time_base = Fraction(1, TICKS)
        self._began, self._ticks = first.light_ns, -1

    def add(self, picture: FilmedPicture) -> None:
        """Each is later than the one before, also where their light was not."""
        since = (picture.light_ns - self._began) * TICKS // 1_000_000_000
        self._ticks = max(self._ticks + 1, since)
        packet = self._packet(picture.data)
        packet.stream = self._stream
        packet.time_base = Fraction(1, TICKS)
        packet.pts = packet.dts = self._ticks
        packet.is_keyframe = picture.keyframe
        self._out.mux_one(packet)

    def close(self) -> None:
        self._out.close()


class Subtitles:
    """Lines with their times since the film began; equal ones that follow each other are one."""

    def __init__(self) -> None:
        self._lines: list[tuple[int, str]] = []
        self._due = self._end = 0  # [ns]

    def add(self, at_ns: int, line: str) -> None:
        """A picture's line, [ns] since the film began."""
        self._end = at_ns
        if at_ns < self._due:
            return
        self._due = at_ns + STEP_NS
        if not self._lines or line != self._lines[-1][1]:
            self._lines.append((at_ns, line))

    def text(self) -> str:
        """The file."""
        ends = [at for at, _ in self._lines[1:]] + [self._end + LAST_NS]
        return "\n".join(
            f"{number}\n{_time(begin)} --> {_time(end)}\n{line}\n"
            for number, ((begin, line), end) in enumerate(zip(self._lines, ends, strict=True), 1)
        )


def _time(ns: int) -> str:
    seconds, ms = divmod(round(ns / 1e6), 1000)
    minutes, s = divmod(seconds, 60)
    hours, m = divmod(minutes, 60)
    return f"{hours:02d}:{m:02d}:{s:02d},{ms:03d}"
