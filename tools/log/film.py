"""`lindy log film`: the pictures of a recording as a film that any player and editor opens, with
subtitles in the SubRip format (.srt): what the pilot saw beside the picture. Pictures are copied
through PyAV, not coded anew."""

import io
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from fractions import Fraction
from itertools import chain, groupby
from math import degrees, inf
from pathlib import Path
from typing import Annotated, BinaryIO, NamedTuple

from cyclopts import Parameter

from messages import cameras, topics
from messages.cameras import FIRST
from messages.sensors import TemperatureSample
from messages.state import VehicleState
from messages.text import harmless
from messages.vehicle import VehicleStatus
from messages.video import Assembler, FilmKind, FilmRequest, VideoPart
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from tools.choices import NewFile
from tools.exit_status import DONE, LOST
from tools.fresh import new_file, refuse_existing, write_fresh
from tools.packages import require_package
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording
from tools.text_table import counted

VIDEOS = (topics.VIDEO, topics.FURTHER_VIDEO)
LATEST = 512  # states that are remembered: five seconds, longer than a picture is under way
Camera = Annotated[
    str, Parameter(help="take this camera, or `all`; default: the one that was large the longest")
]
OLD_NS = 1_000_000_000  # [ns] before a picture: where the drone was then is not where it is


class FilmPlace(NamedTuple):
    """None: not known."""

    at_ns: int  # [ns] UTC
    depth: float | None = None  # [m] positive down
    heading: float | None = None  # [°] clockwise from north, 0 … 360
    north: float | None = None  # [m] NED
    east: float | None = None  # [m]
    flight_mode: str = ""
    water: float | None = None  # [°C]

    @property
    def utc(self) -> datetime:
        return datetime.fromtimestamp(self.at_ns // 10**9, UTC)

    @property
    def words(self) -> str:
        """One line."""
        place = self.north is not None and self.east is not None
        said = (
            f"{self.utc:%Y-%m-%d %H:%M:%S} UTC",
            "depth –" if self.depth is None else f"depth {self.depth:.1f} m",
            "heading –" if self.heading is None else f"heading {round(self.heading) % 360:03d}°",
            f"north {self.north:.1f} m, east {self.east:.1f} m" if place else "",
            self.flight_mode.replace("_", " "),
            "" if self.water is None else f"water {self.water:.1f} °C",
        )
        return " · ".join(filter(None, said))


class FilmedPicture(NamedTuple):
    light_ns: int  # [ns] UTC
    size: tuple[int, int]  # [px] width, height
    keyframe: bool
    data: bytes  # H.264, Annex B
    drone: FilmPlace


def pictures(
    recording: Recording, left_out: set[int] | None = None, camera: str = FIRST
) -> Iterator[FilmedPicture]:
    """Every picture of a camera that can be decoded with those before it, in their order.

    Args:
        left_out: becomes the stamps [ns] of the others.
    """
    told = topics.STATE, topics.STATUS, topics.TEMPERATURE, cameras.video(camera)
    left_out = set() if left_out is None else left_out
    assembler, seen = Assembler(), deque[FilmPlace](maxlen=LATEST)
    mode, water, seq, broken = "", None, None, True
    for _, message, _, publish_ns in recording.of(*told):
        match message:
            case VehicleState() as state:
                seen.append(_place(state, publish_ns, mode, water))
            case VehicleStatus(flight_mode=mode):
                pass
            case TemperatureSample(water=water):
                pass
            case VideoPart() as part:
                broken = broken or (seq is not None and part.seq != seq + 1)
                seq = part.seq
                left_out.add(part.stamp_ns)
                unit = assembler.take(part)
                if unit is None or (broken and not part.keyframe):
                    continue
                broken = False
                left_out.discard(part.stamp_ns)
                size = part.width, part.height
                # The newest place that is no younger than the light, and not much older.
                oldest = publish_ns - OLD_NS
                known = (each for each in reversed(seen) if oldest < each.at_ns <= publish_ns)
                drone = next(known, FilmPlace(publish_ns))._replace(at_ns=publish_ns)
                yield FilmedPicture(publish_ns, size, part.keyframe, unit.data, drone)
            case _:
                pass


def filmed_cameras(recording: Recording) -> list[str]:
    """Cameras of which the recording has pictures: the one that was large for the longest, then the
    others by name."""
    seen, large = set[str](), Counter[str]()
    for raw in recording.raw():
        camera = cameras.camera_of(raw.key)
        if camera is not None and topics.find(raw.key) in VIDEOS:
            seen.add(camera)
        elif topics.CAMERA_SHARES.covers(raw.key):  # five a second, from the large one
            large[raw.key.rpartition("/")[2]] += 1
    longest = max(sorted(seen), key=lambda name: (large[name], name == FIRST), default=FIRST)
    return sorted(seen, key=lambda name: (name != longest, name))


def chosen(recording: Recording, camera: str = "") -> list[str]:
    """The cameras that are meant; the one that was large for the longest first.

    Args:
        camera: its name, `all`, or empty: the default.

    Raises:
        LindyError: the recording is empty, has no pictures, or none of this camera.
    """
    recording.require_messages()
    there = filmed_cameras(recording)
    if not there:
        raise LindyError(f"{recording.files[0]} holds no pictures")
    if camera in ("", cameras.ALL):
        return there
    if camera not in there:
        known = sorted(there)
        raise LindyError(
            f"{recording.files[0]} holds no pictures of {camera!r}{nearest(camera, known)}"
        )
    return [camera]


def marks(recording: Recording, camera: str = "") -> list[tuple[FilmKind, int]]:
    """What the pilot filmed: kind, and [ns] UTC of the light of the picture that was seen.

    Args:
        camera: of this one only; empty: of all.
    """
    found = dict[str, tuple[FilmKind, int]]()
    for _, message, _, publish_ns in recording.of(topics.FILM_REQUEST):
        if isinstance(message, FilmRequest):
            own = message.kind == "end" or (message.camera or FIRST) == camera
            if camera and not own:
                continue
            light = publish_ns + message.light_ns - message.stamp_ns
            found.setdefault(message.id, (message.kind, light))
    return sorted(found.values(), key=lambda each: each[1])


def filmed_spans(recording: Recording, camera: str) -> list[tuple[int, float]]:
    """[ns] UTC from when to when the pilot filmed with this camera, which was the large one when
    that began. What was not ended lasts to the end."""
    spans, began = list[tuple[int, float]](), None
    for kind, light in marks(recording, camera):
        if kind == "begin" and began is None:
            began = light
        elif kind == "end" and began is not None:
            spans.append((began, light))
            began = None
    return spans if began is None else [*spans, (began, inf)]


def within(
    found: Iterable[FilmedPicture], spans: Sequence[tuple[int, float]]
) -> Iterator[tuple[int, FilmedPicture]]:
    """The pictures of each span, with its number, from the keyframe on that it needs."""
    number, inside = 0, False
    group = list[FilmedPicture]()  # since the newest keyframe
    for picture in found:
        while number < len(spans) and picture.light_ns > spans[number][1]:
            number, inside = number + 1, False
        if number == len(spans):
            return
        if picture.keyframe:
            group = []
        group.append(picture)
        if picture.light_ns >= spans[number][0]:
            for each in [picture] if inside else group:
                yield number, each
            inside = True


def _place(state: VehicleState, at_ns: int, mode: str, water: float | None) -> FilmPlace:
    heading = state.heading_navigation
    place = state.north, state.east
    north, east = (each.value if each is not None and each.valid else None for each in place)
    return FilmPlace(
        at_ns,
        state.depth.value if state.depth.valid else None,
        degrees(heading.value) % 360.0 if heading is not None and heading.valid else None,
        north,
        east,
        mode,
        water,
    )


STEP_NS = 500_000_000  # [ns] between two lines of the subtitles at most
LAST_NS = 500_000_000  # [ns] that the last one is shown
TICKS = 90_000  # [1/s] of a film's time stamps, as editors expect
Spans = Sequence[tuple[int, float]]  # [ns] UTC from when to when


def film(
    recording: Path,
    /,
    *,
    out: NewFile,
    marked: Annotated[
        bool, Parameter(negative=(), help="only what the pilot filmed, a film for each")
    ] = False,
    camera: Camera = "",
) -> int:
    """Write the pictures as a film with subtitles (MP4).

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
    with new_file(path) as file:
        film = CopiedFilm(file, first)
        for picture in chain([first], shown):
            film.add(picture)
            count += 1
            subtitles.add(max(0, picture.light_ns - first.light_ns), picture.drone.words)
        film.close()
    write_fresh(srt, subtitles.text().encode())
    seconds = (picture.light_ns - first.light_ns) / 1e9
    return f"{counted(count, 'picture')}, {seconds:.1f} s, in {path} and {srt}"


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
