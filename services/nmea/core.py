"""The driver of a receiver of GNSS as a pure state machine: sentences become fixes."""

from collections.abc import Callable, Iterable, Sequence
from math import inf, sqrt
from typing import Annotated, NamedTuple

import msgspec

from messages import events
from messages.events import Outbox
from messages.sensors import UsblSample
from messages.units import Ns
from services.instruments.core import GeoPoint, InstrumentWatch, LineCutter, LocalFixes

S = 1_000_000_000  # [ns]
LONGEST = 256  # [bytes] of a line; the standard allows 82
GGA_NS = 3 * S  # [ns] after which RMC is used, which says nothing of its quality
# [m] one standard deviation of a range, by GGA's quality: GPS alone, differential, PPS, RTK fixed
# and float. What a receiver extrapolates, is told or simulates (6, 7, 8) is no fix.
RANGE_ERROR = {1: 4.0, 2: 1.5, 3: 3.0, 4: 0.02, 5: 0.4}
HDOP = 2.0  # [-] where the receiver does not say


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [nmea] of a vehicle file."""

    # udpin:HOST:PORT, tcp:HOST:PORT, serial:DEVICE:BAUD …; empty: there is none.
    url: Annotated[str, msgspec.Meta(max_length=200)] = ""
    origin: GeoPoint | None = None  # [deg] of north and east; None: the first fix
    # [s] from the measurement to the arrival.
    latency: Annotated[float, msgspec.Meta(ge=0.0, le=2.0)] = 0.2


class GnssSentence(NamedTuple):
    """What Lindy uses of a sentence."""

    kind: str  # GGA, RMC, HDT …
    clock: str = ""  # its time of day; only whether it is another one is looked at
    place: GeoPoint | None = None  # [deg]
    quality: int = 0
    hdop: float | None = None


class GnssDriver:
    """Bytes in; samples and events out. Nothing is sent to a receiver."""

    def __init__(
        self,
        settings: Settings,
        fixes: LocalFixes,
        outbox: Outbox,
        read: Callable[[bytes], GnssSentence | None],
    ) -> None:
        """`read`: a line as a sentence; None where it is none."""
        self.watch = InstrumentWatch("gnss", outbox)
        self.told = ""
        self._latency_ns, self._read = round(settings.latency * S), read
        self._fixes, self._cutter = fixes, LineCutter(LONGEST)
        self._gga_ns: Ns | None = None  # of the newest
        self._clock = ""  # of the newest position

    def heard(self, pieces: Iterable[bytes], arrival: Ns) -> Sequence[UsblSample]:
        lines, too_long = self._cutter.lines(pieces)
        self.watch.garbled(too_long)
        samples = [self._sample(line, arrival) for line in lines]
        return [sample for sample in samples if sample is not None]

    def due(self, now: Ns) -> Sequence[bytes]:  # noqa: ARG002 - as of every driver
        return []

    def _sample(self, line: bytes, arrival: Ns) -> UsblSample | None:
        if (said := self._read(line)) is None:
            self.watch.garbled()
            return None
        self.watch.reported(arrival)
        if said.kind not in ("GGA", "RMC"):
            self.told = self.told or "neither GGA nor RMC among its sentences"
            self.watch.measured_nothing(arrival, events.NO_FIX("gnss"))
            return None
        if said.kind == "GGA":
            self._gga_ns = arrival
        elif self._gga_ns is not None and arrival - self._gga_ns < GGA_NS:
            return None
        again, self._clock = said.clock == self._clock != "", said.clock
        if again or said.place is None or said.quality not in RANGE_ERROR:
            self.told = "no position"
            self.watch.measured_nothing(arrival, events.NO_FIX("gnss"))
            return None
        hdop = said.hdop if said.hdop and 0.0 < said.hdop < inf else HDOP
        std = min(1e6, hdop * RANGE_ERROR[said.quality] / sqrt(2.0))
        self.told = f"{said.kind} of quality {said.quality}, good to {std:.1f} m"
        self.watch.measured()
        return self._fixes.sample(*said.place, std, arrival - self._latency_ns)
