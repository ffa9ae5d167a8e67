"""`lindy log film`: the pictures of a recording as a film that any player and editor opens, with
subtitles in the SubRip format (.srt): what the pilot saw beside the picture."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain, groupby
from math import inf
from pathlib import Path
from typing import Annotated, BinaryIO, Protocol

from cyclopts import Parameter

from messages import cameras
from messages.text import harmless
from services.marine.field_of_view import CameraViews
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from tools.choices import NewFile
from tools.exit_status import DONE, LOST
from tools.fresh import EXISTS, refuse_existing, write_fresh
from tools.log.film_scenes import Camera, FilmedPicture, chosen, filmed_spans, pictures, within
from tools.packages import require_package
from tools.recordings.dive_file import flown_section
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

STEP_NS = 500_000_000  # [ns] between two lines of the subtitles at most
LAST_NS = 500_000_000  # [ns] that the last one is shown
Spans = Sequence[tuple[int, float]]  # [ns] UTC from when to when


class FilmFile(Protocol):
    """An MP4 that is being written."""

    def add(self, picture: FilmedPicture) -> bool:
        """Whether it is in the film; otherwise it is damaged."""
        ...

    def close(self) -> None: ...


NewFilm = Callable[[BinaryIO, FilmedPicture], FilmFile]  # the first picture is a keyframe


def film(
    recording: Path,
    *,
    out: NewFile,
    overlay: Annotated[
        bool, Parameter(negative=(), help="horizon, depth, heading … in the picture: encoded anew")
    ] = False,
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
             lindy log film dives/latest --overlay --out shown.mp4
             lindy log film dives/latest --camera all --out dive.mp4
    """
    if out.suffix != ".mp4":
        raise LindyError(f"--out {out}: expected a name that ends in .mp4")
    opened = open_recording(recording)
    with reading("filming", opened.size) as opened.advance:
        made = filmed(opened, out, overlay=overlay, marked=marked, camera=camera)
    print(harmless("\n".join([*made, *opened.damage])), flush=True)
    return LOST if opened.damage else DONE


def filmed(
    recording: Recording,
    out: Path,
    *,
    overlay: bool = False,
    marked: bool = False,
    camera: str = "",
) -> list[str]:
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
    said = [_filmed(recording, n, path, spans[n], overlay=overlay) for n, path in paths.items()]
    return [sentence for each in said for sentence in each]


def _filmed(
    recording: Recording, camera: str, out: Path, spans: Spans, *, overlay: bool
) -> list[str]:
    """The films of one camera: one for each span, and for each size."""
    views = flown_section(recording, "camera", CameraViews) if overlay else None
    view = None if views is None else views.by_name.get(camera)
    require_package("av", "camera", "a film")
    from tools.log.film_file import CopiedFilm

    new: NewFilm = CopiedFilm
    if overlay:
        from tools.log.film_overlay import DrawnFilm

        new = partial(DrawnFilm, view=view)
    said, left_out = list[str](), set[int]()
    scenes = within(pictures(recording, left_out, camera), spans)
    films = groupby(scenes, key=lambda each: (each[0], each[1].size))
    for number, (_, shown) in enumerate(films, start=1):
        path = out if number == 1 else out.with_name(f"{out.stem}-{number}.mp4")
        said.append(_written(path, new, (picture for _, picture in shown)))
    if not said:
        raise LindyError(f"{recording.files[0]} holds no pictures")
    if overlay and view is None:
        said.append("no horizon: the recording does not say what the camera sees")
    if left_out:
        said.append(
            f"{len(left_out)} pictures of the recording are left out: parts of them, or of those "
            f"that they build on, are missing"
        )
    return said


def _written(path: Path, new: NewFilm, shown: Iterator[FilmedPicture]) -> str:
    """One film and its subtitles, whole or not at all. Returns what it is."""
    subtitles, count, damaged = Subtitles(), 0, 0
    picture = first = next(shown)
    refuse_existing(srt := path.with_suffix(".srt"))
    try:
        file = path.open("xb")
        try:
            with file:
                film = new(file, first)
                for picture in chain([first], shown):
                    is_in = film.add(picture)
                    subtitles.add(max(0, picture.light_ns - first.light_ns), picture.drone.words)
                    count, damaged = count + is_in, damaged + (not is_in)
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
    without = f", {damaged} damaged ones left out" if damaged else ""
    return f"{count} pictures, {seconds:.1f} s, in {path} and {srt}{without}"


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
