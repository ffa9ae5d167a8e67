"""What the drivers of instruments share.

1. Does an instrument answer, and does it measure? Said once when it begins and when it ends.
2. Lines in a stream of bytes, as of JSON and NMEA.
3. Positions on the earth as fixes in metres, from an origin: a given one, or the first position.

North and east are by the radii of curvature of the ellipsoid WGS 84 at the origin (Farrell 2008,
Aided Navigation, eq. 2.5 and 2.6): below 70° of latitude they are off by 0.25 m at a distance of
1 km, and by the square of it beyond.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import cos, hypot, radians, sin, sqrt
from typing import Annotated

import msgspec

from messages import events, topics
from messages.events import Event, Outbox
from messages.sensors import UsblSample
from messages.units import Ns

S = 1_000_000_000  # [ns]
AGAIN_NS = 5 * S  # [ns] of silence after which the connection is made anew, and again
EMPTY_NS = 3 * S  # [ns] of reports without a measurement that are worth a sentence
OTHER_NS = 3 * S  # [ns] for which another instrument's measurement counts
GARBLED = "what arrives cannot be read: is it this instrument, and this speed of the cable?"


@dataclass(slots=True)
class InstrumentWatch:
    """Fed with what arrives; asked now and then."""

    name: str  # in health and log: `dvl`
    outbox: Outbox
    silent_ns: Ns = 3 * S  # [ns] without a report
    only_asks: bool = False  # as of `lindy doctor`: nothing is set up
    answers: bool = False
    _since: Ns | None = None  # of the newest report, or since when it is waited for
    _again: Ns = 0  # when the connection is made anew
    _garbled: int = 0  # arrivals since then that could not be read
    _said: bool = False
    _empty_ns: Ns | None = None  # since when it measures nothing
    _said_empty: bool = False

    def reported(self, now: Ns) -> bool:
        """A report was read. True: the first one after a silence."""
        first, self.answers = not self.answers, True
        self._since, self._said, self._garbled = now, False, 0
        if first:
            self.outbox.tell(events.ANSWERING(self.name))
        return first

    def garbled(self, times: int = 1) -> None:
        """Something arrived that is no report."""
        self.outbox.tell(events.MALFORMED(self.name), times)
        self._garbled += times

    def measured(self) -> None:
        """A report had a measurement in it."""
        self._empty_ns, self._said_empty = None, False

    def measured_nothing(self, now: Ns, event: Event) -> None:
        """A report had none in it; what that is called is told once it lasts."""
        if self._empty_ns is None:
            self._empty_ns = now
        if not self._said_empty and now - self._empty_ns >= EMPTY_NS:
            self._said_empty = True
            self.outbox.tell(event)

    def gives_up(self, now: Ns, trouble: str = "") -> bool:
        """Is the connection to be made anew? To be asked several times a second.

        Args:
            trouble: why the connection failed, for people; empty: not known.
        """
        if self._since is None:
            self._since = now
        if now - self._since < self.silent_ns:
            self._again = now + AGAIN_NS
            return False
        self.answers = False
        if not self._said:
            why = trouble or (GARBLED if self._garbled else "")
            self.outbox.tell(events.SILENT_INSTRUMENT(self.name, detail=why))
            self._said = True
        if now < self._again:
            return False
        self._again = now + AGAIN_NS
        return True


@dataclass(slots=True)
class FirstOfTwo:
    """Where two instruments measure the same, who came first goes on. `other`: the name of one that
    measures it by other means, so that both are there on purpose."""

    name: str
    outbox: Outbox
    other: str = ""
    _own_ns: Ns | None = None  # of the newest that was used
    _other_ns: Ns | None = None  # another one's newest

    def heard_other(self, now: Ns) -> None:
        """Another service has published a measurement of the same."""
        before, self._other_ns = self._other_ns, now
        if before is None or now - before > OTHER_NS:
            if self.other:
                self.outbox.tell(events.SECOND_POSITION(self.name, detail=f"now {self.other}"))
            else:
                self.outbox.tell(events.SECOND_INSTRUMENT(self.name))

    def uses_own(self, now: Ns, *, measured: bool = True) -> bool:
        """To be asked for each sample of its own; one may say only that it measures nothing."""
        if _within(self._other_ns, now) and not _within(self._own_ns, now):
            return False
        self._own_ns = now if measured else self._own_ns
        return True


def _within(then: Ns | None, now: Ns) -> bool:
    return then is not None and now - then <= OTHER_NS


class LineCutter:
    """Keeps the rest of an unfinished line; never more than the longest one."""

    def __init__(self, longest: int) -> None:
        """`longest`: [bytes] of a line; what is longer is left out up to its end."""
        self._longest, self._rest, self._skips = longest, b"", False

    def lines(self, pieces: Iterable[bytes]) -> tuple[list[bytes], int]:
        """Whole lines in order without their ends, empty ones left out, and how many were too
        long."""
        *lines, rest = (self._rest + b"".join(pieces)).split(b"\n")
        if lines and self._skips:
            lines, self._skips = lines[1:], False
        kept = [line.strip() for line in lines if len(line) <= self._longest]
        too_long = len(lines) - len(kept)
        if len(rest) > self._longest:
            rest, too_long, self._skips = b"", too_long + (not self._skips), True
        self._rest = b"" if self._skips else rest
        return [line for line in kept if line], too_long


SEMI_MAJOR = 6_378_137.0  # [m]
ECCENTRICITY2 = 6.694379990141e-3  # [-] squared
Latitude = Annotated[float, msgspec.Meta(ge=-89.0, le=89.0)]  # [deg] + is north
Longitude = Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]  # [deg] + is east
GeoPoint = tuple[Latitude, Longitude]  # [deg]


def is_on_earth(latitude: float, longitude: float) -> bool:
    """Can it be a position? (0, 0) is what a receiver without one says."""
    if latitude == longitude == 0.0:
        return False
    return abs(latitude) <= 89.0 and abs(longitude) <= 180.0


def north_east(origin: GeoPoint, latitude: float, longitude: float) -> tuple[float, float]:
    """[m] North and east of the origin."""
    sine = sin(radians(origin[0]))
    w = 1.0 - ECCENTRICITY2 * sine * sine
    meridian = SEMI_MAJOR * (1.0 - ECCENTRICITY2) / (w * sqrt(w))
    parallel = SEMI_MAJOR / sqrt(w) * cos(radians(origin[0]))
    east = (longitude - origin[1] + 180.0) % 360.0 - 180.0
    return meridian * radians(latitude - origin[0]), parallel * radians(east)


FARTHEST = 50_000.0  # [m] from the origin; no dive goes there, and north and east no longer mean it


class OriginCheckpoint(msgspec.Struct, frozen=True):
    """What a driver that is started again must know, so that the map does not move."""

    origin: GeoPoint


class LocalFixes:
    """From latitude and longitude to north and east."""

    def __init__(
        self,
        name: str,
        outbox: Outbox,
        origin: GeoPoint | None,
        remember: Callable[[OriginCheckpoint], None] = lambda _: None,
    ) -> None:
        """
        Args:
            name: of the instrument, in health and log.
            origin: [deg] None: the first position, which is then to be remembered.
        """
        self._origin, self._remember = origin, remember
        self._name, self._outbox = name, outbox
        self._stamp_ns: Ns | None = None  # of the newest

    def sample(
        self, latitude: float, longitude: float, std: float, stamp_ns: Ns
    ) -> UsblSample | None:
        """None: it can be no position, or is not newer than the last one.

        Args:
            std: [m] one standard deviation of each component.
        """
        if not is_on_earth(latitude, longitude):
            self._outbox.tell(events.IMPLAUSIBLE(self._name))
            return None
        if self._origin is None:
            self._origin = (latitude, longitude)
            self._remember(OriginCheckpoint(self._origin))
            where = f"{latitude:.7f}, {longitude:.7f}, the first position"
            self._outbox.tell(events.ORIGIN(self._name, detail=where))
        north, east = north_east(self._origin, latitude, longitude)
        if hypot(north, east) > FARTHEST:
            self._outbox.tell(events.IMPLAUSIBLE(self._name))
            return None
        if self._stamp_ns is not None and stamp_ns <= self._stamp_ns:
            self._outbox.tell(events.NOT_NEWER(topics.USBL.key))
            return None
        self._stamp_ns = stamp_ns
        return UsblSample(stamp_ns=stamp_ns, north=north, east=east, std=std)
