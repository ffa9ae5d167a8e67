"""The camera between a picture and the parts of its access unit. Time is an argument; pictures and
the encoder are elsewhere."""

from typing import Annotated, NamedTuple

import msgspec

from messages import events
from messages.events import Event
from messages.link import LinkStatus
from messages.units import Ns
from messages.video import HEADERS, LONGEST_UNIT, PictureAge, VideoPart
from services.camera.bitrate import BitrateLaw
from services.camera.capture_time import Light
from services.camera.pacing import Pacer, encoder_kbit, pictures_per_second, split
from services.camera.sea import WaterLight
from services.marine.field_of_view import FieldOfView

SIMULATED = "simulated"
STALE_NS = 200_000_000  # [ns] a picture that came longer ago is not even encoded
PictureSide = Annotated[int, msgspec.Meta(ge=64, le=4096, multiple_of=2)]
VideoKilobits = Annotated[float, msgspec.Meta(ge=4.0, le=50_000.0)]


class Settings(FieldOfView, frozen=True, forbid_unknown_fields=True):
    """The table [camera] of a vehicle file.

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


class Order(NamedTuple):
    """How the encoder is to encode a picture."""

    kbit: float  # [kbit/s]
    hz: float  # [1/s] pictures of which this is one
    keyframe: bool


class Camera:
    """Decides which pictures are encoded, and how."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._law = BitrateLaw(settings.least_kbit, settings.most_kbit)
        self._pacer = Pacer()
        self._kbit = 0.0  # [kbit/s] of the encoder
        self._cut = False  # the link is known to be interrupted
        self._keyframe_wanted = False
        self._keyframe = 0  # number of the last one
        self._pictures = 0

    def heard(self, report: PictureAge, now: Ns) -> None:
        """What the topside says of the picture."""
        self._law.heard(report, now)
        # Nothing after the last keyframe has arrived: it may still be on its way.
        seen = report.newest is None or report.newest >= self._keyframe
        self._keyframe_wanted = self._keyframe_wanted or (report.keyframe_wanted and seen)

    def link(self, status: LinkStatus) -> None:
        self._cut = not status.up

    def budget(self, now: Ns) -> float:
        """[kbit/s]"""
        return self._settings.least_kbit if self._cut else self._law.budget(now)

    def order(self, came: Ns, now: Ns) -> Order | Event:
        """How to encode a picture that came then; or why it is left out."""
        self._pictures += 1
        if now > came + STALE_NS:
            return events.STALE_PICTURE()
        budget = self.budget(now)
        kbit = encoder_kbit(budget, self._kbit)
        hz = pictures_per_second(budget, self._settings.rate)
        if not self._pacer.admits(now, hz):
            return events.LEFT_OUT_PICTURE()
        keyframe = kbit != self._kbit or self._keyframe_wanted or self._pacer.wants_keyframe(now)
        return Order(kbit, hz, keyframe)

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
        pieces = split(data, self._law.room_kbit)
        size = len(data) + HEADERS * len(pieces)
        self._pacer.sent(size, order.kbit, order.hz, keyframe=order.keyframe, now=encoded)
        return [
            VideoPart(
                stamp_ns=light.at_ns,
                exact=light.exact,
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
