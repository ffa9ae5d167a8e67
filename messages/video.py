"""The drone's picture as it crosses the link, and how old it is topside. From `camera` and
`link_monitor`."""

from typing import Annotated, Literal

import msgspec

from messages.link import Stage, Stages
from messages.message import Answer, Message, Request
from messages.units import Count, Name, NotNegative, Share, Stamp, Text

HEADERS = 200  # [B] of one message besides its data: its other fields, and those of the network
LONGEST_PART = 60_000  # [B] of one message
MOST_PARTS = 256  # of one access unit
LONGEST_UNIT = 900_000  # [B] of one access unit, below what a port keeps
Part = Annotated[int, msgspec.Meta(ge=0, le=MOST_PARTS - 1)]
Parts = Annotated[int, msgspec.Meta(ge=1, le=MOST_PARTS)]
Pixels = Annotated[int, msgspec.Meta(ge=0, le=16_384)]
Data = Annotated[bytes, msgspec.Meta(max_length=LONGEST_PART)]

# The stages of a picture, from the light to the whole picture topside. Each is a difference of two
# stamps.
PICTURE_STAGES = ("captured", "encoded", "crossed")


class VideoPart(Message, frozen=True, kw_only=True):
    """A part of one access unit of H.264 in Annex B form, which is one picture. All parts of a
    picture have its number and stamp; `messages.video.Assembler` puts them together again.

    `stamp_ns` is when the light of the picture arrived; unless `exact`, it arrived then or earlier.
    A keyframe begins with its parameter sets, so that anybody can begin to decode there.
    """

    picture: Count  # number of the picture, also of those that were not sent
    keyframe: bool
    part: Part = 0  # which one
    parts: Parts = 1  # of how many
    width: Pixels  # [px]
    height: Pixels  # [px]
    exact: bool = False  # the source says when the light arrived
    stripe: bool = False  # the simulated camera has drawn that time into the picture
    captured_ns: Stamp  # [ns] the picture was in memory
    encoded_ns: Stamp  # [ns] its access unit was there
    budget_kbit: NotNegative  # [kbit/s] what the camera may send, when this was encoded
    data: Data


class PictureAge(Message, frozen=True, kw_only=True):
    """How old the picture is where it is seen, and what the link let through, over the last report
    period. From `link_monitor`; the camera's bitrate follows it. None: not known now."""

    picture_ns: Stamp | None = None  # [ns] stamp of the newest picture that can be decoded
    age_ms: NotNegative | None = None  # [ms] of that picture now; it grows while none arrives
    exact: bool = False  # that is its age; False: at least that
    stages: Stages | None = None  # PICTURE_STAGES, in their order
    total: Stage | None = None  # "light to picture", measured end to end
    per_second: NotNegative = 0.0  # [1/s] pictures that can be decoded
    heard_kbit: NotNegative = 0.0  # [kbit/s] that arrived, without headers
    room_kbit: NotNegative | None = None  # [kbit/s] at which its parts arrive, with headers
    lost: Share = 0.0  # [-] of the period's pictures that did not arrive whole
    newest: Count | None = None  # number of the newest picture of which anything arrived
    keyframe_wanted: bool = False  # nothing can be decoded before the next one


class CameraChoice(Message, frozen=True, kw_only=True):
    """Which camera is to be the large one. From the pilot's page: said when it is chosen, and once
    a second while its pilot has control. The newest that arrives counts."""

    camera: Name
    source: Name = ""  # who chose it


class CameraShares(Message, frozen=True, kw_only=True):
    """What each camera may send, by `services.camera.pacing`. The large camera says it, which alone
    measures the link. A dive with one camera has none."""

    large: Name
    total_kbit: NotNegative  # [kbit/s] for the pictures of all cameras
    kbit: Annotated[dict[Name, NotNegative], msgspec.Meta(max_length=16)]  # [kbit/s] 0: none


class AccessUnit(msgspec.Struct, frozen=True):
    """A picture put together again."""

    about: VideoPart  # without its data
    data: bytes  # H.264, Annex B


class Assembler:
    """Puts access units together from their parts. Of a picture that is not whole when a part of a
    newer one arrives nothing is used: it is dropped whole."""

    def __init__(self) -> None:
        self.dropped = 0  # pictures of which only some parts arrived
        self._of: VideoPart | None = None  # any part of the newest picture
        self._data: dict[int, bytes] = {}  # its parts so far; empty once it is complete

    def take(self, part: VideoPart) -> AccessUnit | None:
        """The access unit that this part completes, or None."""
        if part.part >= part.parts:
            return None
        if self._of is None or not _same(self._of, part):
            if self._of is not None and part.encoded_ns < self._of.encoded_ns:
                return None  # of a picture that was given up
            self.dropped += bool(self._data)
            self._of, self._data = part, {}
        elif not self._data:
            return None  # this picture is complete
        self._data[part.part] = part.data
        if len(self._data) < part.parts:
            return None
        data = b"".join(self._data[number] for number in range(part.parts))
        self._data = {}
        return AccessUnit(msgspec.structs.replace(part, part=0, data=b""), data)


class UnitStream:
    """The access units of one camera that can be decoded: each builds on those before it."""

    def __init__(self) -> None:
        self.broken = True  # nothing can be decoded before the next keyframe
        self.breaks = 0  # times that a part was missing in a stream that could be decoded
        self.undecodable = 0  # whole access units that build on one that is missing
        self._assembler = Assembler()
        self._seq: int | None = None

    @property
    def dropped(self) -> int:
        """Pictures of which only some parts arrived."""
        return self._assembler.dropped

    def take(self, part: VideoPart) -> AccessUnit | None:
        """The access unit that this part completes, unless one that it builds on is missing."""
        if self._seq is not None and part.seq != self._seq + 1:
            self.breaks += not self.broken
            self.broken = True
        self._seq = part.seq
        unit = self._assembler.take(part)
        if unit is not None and self.broken and not part.keyframe:
            self.undecodable += 1
            return None
        self.broken = self.broken and unit is None
        return unit


def _same(one: VideoPart, other: VideoPart) -> bool:
    """Are both parts of one picture?"""
    return (one.picture, one.stamp_ns, one.parts) == (other.picture, other.stamp_ns, other.parts)


# What the pilot films: marks in the recording, which has every picture anyway. From the pilot's
# page; the recorder on board answers whether it records.

FilmKind = Literal["begin", "end", "snapshot"]


class FilmRequest(Request, frozen=True, kw_only=True):
    """Repeated with the same id until a `FilmAnswer` names that id."""

    kind: FilmKind
    light_ns: Stamp  # [ns] stamp of the newest picture that the pages had been sent
    source: Name = ""  # who films
    camera: Name = ""  # of which camera; empty: there is one only


class FilmAnswer(Answer, frozen=True, kw_only=True):
    """`accepted`: the recorder on board has the request, and the pictures about it."""

    reason: Text = ""  # why it records nothing now
