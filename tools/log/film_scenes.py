"""A recording's pictures, and where the drone was when the light of each arrived."""

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from math import degrees, inf
from typing import Annotated, NamedTuple

from cyclopts import Parameter

from messages import cameras, topics
from messages.cameras import FIRST
from messages.film import FilmKind, FilmRequest
from messages.sensors import TemperatureSample
from messages.state import VehicleState
from messages.vehicle import VehicleStatus
from messages.video import Assembler, VideoPart
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from tools.recordings.recording import Recording

VIDEOS = (topics.VIDEO, topics.FURTHER_VIDEO)
LATEST = 512  # states that are remembered: five seconds, longer than a picture is under way
Camera = Annotated[
    str, Parameter(help="of this camera, or `all`; default: the one that was large the longest")
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
