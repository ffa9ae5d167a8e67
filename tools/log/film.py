"""`lindy log film`: the pictures of a recording as a film that any player and editor opens."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

from cyclopts import Parameter

from messages import cameras
from messages.text import harmless
from services.marine.field_of_view import CameraViews, FieldOfView
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.choices import NewFile
from tools.fresh import EXISTS, refuse_existing, write_fresh
from tools.log.film_cameras import Camera, chosen
from tools.log.film_scenes import FilmedPicture, filmed_spans, pictures, within
from tools.log.subtitles import Subtitles
from tools.recordings.dive_file import flown_section
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

if TYPE_CHECKING:
    from tools.log.film_file import CopiedFilm

COMPLETE, INCOMPLETE = 0, 3  # exit statuses
Spans = Sequence[tuple[int, float]]  # [ns] UTC from when to when


class FilmFile(Protocol):
    """An MP4 that is being written."""

    def add(self, picture: FilmedPicture) -> bool:
        """Whether it is in the film; otherwise it is damaged."""
        ...

    def close(self) -> None: ...


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
    return INCOMPLETE if opened.damage else COMPLETE


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
    recording: Recording,
    camera: str,
    out: Path,
    spans: Spans,
    *,
    overlay: bool,
) -> list[str]:
    """The films of one camera."""
    said, what, left_out = list[str](), None, set[int]()
    writing: _Writing | None = None
    views = flown_section(recording, "camera", CameraViews) if overlay else None
    view = None if views is None else views.by_name.get(camera)
    try:
        for span, picture in within(pictures(recording, left_out, camera), spans):
            if (span, picture.size) != what:
                if writing is not None:
                    said.append(writing.end())
                what = span, picture.size
                number = len(said) + 1
                path = out if number == 1 else out.with_name(f"{out.stem}-{number}.mp4")
                writing = _Writing(path, picture, view, overlay=overlay)
            assert writing is not None
            writing.add(picture)
        if writing is None:
            raise LindyError(f"{recording.files[0]} holds no pictures")
        said.append(writing.end())
        if overlay and view is None:
            said.append("no horizon: the recording does not say what the camera sees")
    except BaseException:
        if writing is not None:
            writing.give_up()
        raise
    if left_out:
        said.append(
            f"{len(left_out)} pictures of the recording are left out: parts of them, or of those "
            f"that they build on, are missing"
        )
    return said


class _Writing:
    """One film and its subtitles."""

    def __init__(
        self, path: Path, first: FilmedPicture, view: FieldOfView | None, *, overlay: bool
    ) -> None:
        try:
            from tools.log.film_file import CopiedFilm, new_file
        except ModuleNotFoundError:
            raise LindyError(
                f"a film needs PyAV, which is not installed; {how_to_install('camera')}"
            ) from None
        self._path, self._srt = path, path.with_suffix(".srt")
        self._began, self._end, self._pictures = first.light_ns, first.light_ns, 0
        self._damaged = 0  # pictures
        self._subtitles = Subtitles()
        refuse_existing(self._srt)
        with _said(path):
            self._file = new_file(path)
            try:
                self._film = self._opened(first, view, CopiedFilm, overlay=overlay)
            except BaseException:
                self.give_up()
                raise

    def _opened(
        self,
        first: FilmedPicture,
        view: FieldOfView | None,
        copied: "type[CopiedFilm]",
        *,
        overlay: bool,
    ) -> FilmFile:
        if not overlay:
            return copied(self._file, first)
        from tools.log.film_overlay import DrawnFilm

        return DrawnFilm(self._file, first, view)

    def add(self, picture: FilmedPicture) -> None:
        with _said(self._path):
            shown = self._film.add(picture)
        self._subtitles.add(max(0, picture.light_ns - self._began), picture.drone.words)
        self._end, self._pictures = picture.light_ns, self._pictures + shown
        self._damaged += not shown

    def end(self) -> str:
        with _said(self._path):
            self._film.close()
            self._file.close()
        write_fresh(self._srt, self._subtitles.text().encode())
        seconds = (self._end - self._began) / 1e9
        damaged = f", {self._damaged} damaged ones left out" if self._damaged else ""
        where = f"in {self._path} and {self._srt}"
        return f"{self._pictures} pictures, {seconds:.1f} s, {where}{damaged}"

    def give_up(self) -> None:
        """It is not whole: nothing of it stays."""
        if not self._file.closed:
            self._file.close()
            self._path.unlink(missing_ok=True)


@contextmanager
def _said(path: Path) -> Generator[None]:
    try:
        yield
    except FileExistsError:
        raise LindyError(f"cannot write {path}: {EXISTS.format('--out')}") from None
    except OSError as error:
        raise LindyError(f"cannot write {path}: {reason(error)}") from None
