"""The camera between a picture and the parts of its access unit. Time is an argument; pictures and
the encoder are elsewhere."""

from typing import Annotated, NamedTuple

import msgspec

from messages import cameras, events
from messages.events import Event
from messages.link import LinkStatus
from messages.units import Ns
from messages.video import (
    HEADERS,
    LONGEST_UNIT,
    CameraChoice,
    CameraShares,
    PictureAge,
    VideoPart,
)
from services.camera.bitrate import FIRST_KBIT, BitrateLaw
from services.camera.capture_time import Light
from services.camera.pacing import Pacer, Range, encoder_kbit, pictures_per_second, shares, split
from services.camera.sea import WaterLight
from services.marine.field_of_view import FieldOfView
from services.marine.summation import plain_sum

SIMULATED = "simulated"
FURTHER = "camera_"  # the name of a further camera's service begins so
STALE_NS = 200_000_000  # [ns] a picture that came longer ago is not even encoded
SHARES_NS = 2_000_000_000  # [ns] without a word of the large camera: it is silent
# A camera's own H.264 is sent as it comes where it has had this room for so long.
PASSED_ROOM, PASSED_AFTER_NS = 1.2, 2_000_000_000  # [-] of its bitrate, [ns]
PASSED_HZ = 1.1  # [-] of the pictures wanted, that it may give
PictureSide = Annotated[int, msgspec.Meta(ge=64, le=4096, multiple_of=2)]
VideoKilobits = Annotated[float, msgspec.Meta(ge=4.0, le=50_000.0)]


class OneCamera(FieldOfView, frozen=True, forbid_unknown_fields=True):
    """The table of a camera.

    Raises:
        ValueError: least_kbit is above most_kbit.
    """

    # "simulated", a device such as /dev/video0, an address such as rtsp://192.168.2.10/stream, or a
    # file, which is repeated.
    source: Annotated[str, msgspec.Meta(min_length=1, max_length=500)] = SIMULATED
    width: PictureSide = 640  # [px] pictures of another size are scaled
    height: PictureSide = 360  # [px]
    rate: Annotated[float, msgspec.Meta(ge=1.0, le=60.0)] = 25.0  # [1/s] pictures at most
    least_kbit: VideoKilobits = 16.0  # [kbit/s] of a link with no room: a slide show
    most_kbit: VideoKilobits = 2000.0  # [kbit/s]
    water: WaterLight = WaterLight()  # simulated

    def __post_init__(self) -> None:
        if self.least_kbit > self.most_kbit:
            raise ValueError(
                f"least_kbit is {self.least_kbit:g}, expected at most most_kbit {self.most_kbit:g}"
            )


class Settings(OneCamera, frozen=True, forbid_unknown_fields=True):
    """The table [camera] of a vehicle file: the first camera, and the further ones by name, each a
    table such as [camera.more.down].

    Raises:
        ValueError: a further camera cannot have its name, or there are too many.
    """

    more: dict[str, OneCamera] = msgspec.field(default_factory=dict[str, OneCamera])

    def __post_init__(self) -> None:
        super().__post_init__()
        if why := cameras.mistake(self.more):
            raise ValueError(why)

    @property
    def by_name(self) -> dict[str, OneCamera]:
        """Every camera; the first one first."""
        return {cameras.FIRST: self, **self.more}


class Order(NamedTuple):
    """How the encoder is to encode a picture."""

    kbit: float  # [kbit/s]
    hz: float  # [1/s] pictures of which this is one
    keyframe: bool


class Camera:
    """One of a drone's cameras: decides which pictures are encoded, and how. The large camera
    measures the link and says what each may send; a small one keeps to what was said last."""

    def __init__(self, settings: Settings, name: str = cameras.FIRST) -> None:
        """
        Args:
            name: which of the cameras.
        """
        every = settings.by_name
        self._settings = every[name]
        self._name = name
        self._ranges = {n: Range(each.least_kbit, each.most_kbit) for n, each in every.items()}
        self._large = cameras.FIRST
        self._chosen = False  # the pilot has said which is large
        self._said: CameraShares | None = None  # by the large camera, newest
        self._law = self._begun(FIRST_KBIT)
        self._pacer = Pacer()
        self._kbit = 0.0  # [kbit/s] of the encoder
        self._cut = False  # the link is known to be interrupted
        self._keyframe_wanted = False
        self._keyframe = 0  # number of the last one
        self._pictures = 0
        self._fits_ns: Ns | None = None  # [ns] since when the camera's own H.264 has room

    @property
    def is_large(self) -> bool:
        return self._large == self._name

    def heard(self, report: PictureAge, now: Ns) -> None:
        """What the topside says of the picture."""
        if self.is_large:
            self._law.heard(report, now)
        # Nothing after the last keyframe has arrived: it may still be on its way.
        seen = report.newest is None or report.newest >= self._keyframe
        self._keyframe_wanted = self._keyframe_wanted or (report.keyframe_wanted and seen)

    def link(self, status: LinkStatus) -> None:
        self._cut = not status.up

    def chosen(self, choice: CameraChoice) -> None:
        """The pilot says which camera is large. A name that no camera has changes nothing."""
        if choice.camera in self._ranges:
            self._chosen = True
            self._become(choice.camera)

    def told(self, said: CameraShares) -> None:
        """The large camera says what each may send. A camera that was started anew, and has not
        heard the pilot's choice, learns by it which is large."""
        if not self._chosen and said.large in self._ranges:
            self._become(said.large)
        if said.large == self._large:
            self._said = said

    def shares(self, now: Ns) -> CameraShares | None:
        """What each camera may send, as the large one says it; None: this is a small one."""
        if not self.is_large:
            return None
        least = self._settings.least_kbit
        total = least if self._cut else self._law.budget(now)
        return CameraShares(
            stamp_ns=now,
            large=self._name,
            total_kbit=total,
            kbit=shares(total, self._name, self._ranges),
        )

    def budget(self, now: Ns) -> float:
        """[kbit/s] 0: it is to send nothing. A small camera whose large one is silent sends a slide
        show: the pilot may want to make it the large one."""
        said = self.shares(now) or self._said
        if said is None or now > said.stamp_ns + SHARES_NS:
            return self._settings.least_kbit
        return min(said.kbit.get(self._name, 0.0), self._settings.most_kbit)

    def order(self, came: Ns, now: Ns) -> Order | Event:
        """How to encode a picture that came then; or why it is left out."""
        self._pictures += 1
        if now > came + STALE_NS:
            return events.STALE_PICTURE()
        budget = self.budget(now)
        if budget <= 0.0:
            return events.LEFT_OUT_PICTURE()
        kbit = encoder_kbit(budget, self._kbit)
        hz = pictures_per_second(budget, self._settings.rate)
        if not self._pacer.admits(now, hz):
            return events.LEFT_OUT_PICTURE()
        keyframe = kbit != self._kbit or self._keyframe_wanted or self._pacer.wants_keyframe(now)
        return Order(kbit, hz, keyframe)

    def passes(self, kbit: float, hz: float, now: Ns) -> bool:
        """Is the camera's own H.264 to be sent as it comes? It cannot be made smaller, nor begun at
        will: where there is no room for it, or topside wants a keyframe, we encode.

        Args:
            kbit, hz: [kbit/s], [1/s] that it gives.
        """
        room = PASSED_ROOM * kbit <= self.budget(now) and hz <= PASSED_HZ * self._settings.rate
        if not room or self._keyframe_wanted:
            self._keyframe_wanted = self._keyframe_wanted or self._fits_ns is not None
            self._fits_ns = None
            return False
        self._fits_ns = now if self._fits_ns is None else self._fits_ns
        return now > self._fits_ns + PASSED_AFTER_NS

    def passed(self, now: Ns, *, keyframe: bool) -> Order:
        """What is said of a picture that is sent as the camera has encoded it."""
        self._pictures += 1
        return Order(self.budget(now), self._settings.rate, keyframe)

    def parts(
        self, data: bytes, order: Order, light: Light, captured: Ns, encoded: Ns
    ) -> list[VideoPart]:
        """The messages of an access unit; none of one that is empty or absurdly long."""
        self._kbit = order.kbit
        if not data or len(data) > LONGEST_UNIT:
            return []
        if order.keyframe:
            self._keyframe, self._keyframe_wanted = self._pictures, False
        self._law.sent(encoded)
        room = self._law.room_kbit if self.is_large or self._said is None else self._said.total_kbit
        pieces = split(data, room)
        size = len(data) + HEADERS * len(pieces)
        self._pacer.sent(size, order.kbit, order.hz, keyframe=order.keyframe, now=encoded)
        return [
            VideoPart(
                stamp_ns=light.at_ns,
                exact=light.exact,
                stripe=light.stripe,
                picture=self._pictures,
                keyframe=order.keyframe,
                part=number,
                parts=len(pieces),
                width=self._settings.width,
                height=self._settings.height,
                captured_ns=captured,
                encoded_ns=encoded,
                budget_kbit=order.kbit,
                data=piece,
            )
            for number, piece in enumerate(pieces)
        ]

    def _become(self, large: str) -> None:
        """A camera that becomes large begins with what the one before it had found out."""
        if large == self._large:
            return
        self._large = large
        if self.is_large:
            self._law = self._begun(FIRST_KBIT if self._said is None else self._said.total_kbit)
        self._said = None

    def _begun(self, kbit: float) -> BitrateLaw:
        """The law of the link, for the pictures of all cameras."""
        most = plain_sum(bounds.most_kbit for bounds in self._ranges.values())
        return BitrateLaw(self._settings.least_kbit, most, kbit)
