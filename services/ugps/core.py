"""The driver of the Underwater GPS as a pure state machine: answers become fixes.

Its API (HTTP, JSON) from Water Linked's page docs/underwater-gps/integration/api.md in
github.com/waterlinked/waterlinked.github.io, and the description it refers to. Where the topside
box is on the earth and how it is turned, it knows itself.
"""

from collections.abc import Iterable, Sequence
from typing import Annotated

import msgspec

from messages import events
from messages.events import Outbox
from messages.payload import UNDECODABLE
from messages.sensors import UsblSample
from messages.units import Finite, Ns
from services.instruments.core import GeoPoint, InstrumentWatch, LocalFixes

S = 1_000_000_000  # [ns]
ACOUSTIC, GLOBAL = "/api/v1/position/acoustic/filtered", "/api/v1/position/global"
PATHS = (ACOUSTIC, GLOBAL)  # asked for in this order, so that the second is of the first or newer
LEAST_STD, MOST_STD = 0.5, 1000.0  # [m] its own figure leaves out the topside's place and heading
NO_POSITION = b"HTTP 5"  # what a status is that it answers with where it has none


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [ugps] of a vehicle file."""

    # http://HOST[:PORT], as a rule http://192.168.2.94; empty: there is none.
    url: Annotated[str, msgspec.Meta(max_length=200)] = ""
    rate: Annotated[float, msgspec.Meta(ge=0.1, le=10.0)] = 2.0  # [1/s] asked
    origin: GeoPoint | None = None  # [deg] of north and east; None: the first fix
    # [s] of a position that it answers with; its maker states none.
    latency: Annotated[float, msgspec.Meta(ge=0.0, le=3.0)] = 0.25


class AcousticPosition(msgspec.Struct, frozen=True):
    x: Finite  # [m] in the axes of the topside's antenna
    y: Finite  # [m]
    z: Finite  # [m] depth
    std: Annotated[float, msgspec.Meta(ge=0.0, le=MOST_STD)] = 0.0  # [m]
    position_valid: bool = True


class GlobalPosition(msgspec.Struct, frozen=True):
    lat: Finite  # [deg]
    lon: Finite  # [deg]


_ACOUSTIC = msgspec.json.Decoder(AcousticPosition)
_GLOBAL = msgspec.json.Decoder(GlobalPosition)


class UgpsDriver:
    """Answers in; samples and events out."""

    def __init__(self, settings: Settings, fixes: LocalFixes, outbox: Outbox) -> None:
        self.watch = InstrumentWatch("ugps", outbox, silent_ns=round(S * (3.0 + 2 / settings.rate)))
        self.told = ""
        self._latency_ns, self._fixes = round(settings.latency * S), fixes
        self._newest: tuple[AcousticPosition, GlobalPosition] | None = None

    def heard(self, pieces: Iterable[bytes], arrival: Ns) -> Sequence[UsblSample]:
        """`pieces`: what it answered for each of `PATHS`."""
        answers = acoustic, place = tuple(pieces)
        if any(answer.startswith(NO_POSITION) for answer in answers):
            return self._nothing(arrival, "no position")
        try:
            heard = _ACOUSTIC.decode(acoustic), _GLOBAL.decode(place)
        except UNDECODABLE:
            self.watch.garbled()
            return []
        again, self._newest = heard == self._newest, heard
        if again or not heard[0].position_valid:
            return self._nothing(arrival, self.told if again else "no position")
        self.watch.reported(arrival)
        self.watch.measured()
        std = max(LEAST_STD, heard[0].std)
        self.told = f"a position good to {std:.1f} m"
        stamp = arrival - self._latency_ns
        sample = self._fixes.sample(heard[1].lat, heard[1].lon, std, stamp)
        return [] if sample is None else [sample]

    def due(self, now: Ns) -> Sequence[bytes]:  # noqa: ARG002 - as of every driver
        return []

    def _nothing(self, arrival: Ns, told: str) -> Sequence[UsblSample]:
        """There is no position, or none but the one of before."""
        self.watch.reported(arrival)
        self.watch.measured_nothing(arrival, events.NO_FIX("ugps"))
        self.told = told
        return []
