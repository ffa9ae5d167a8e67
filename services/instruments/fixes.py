"""Positions on the earth as fixes in metres, from an origin: a given one, or the first position.

North and east are by the radii of curvature of the ellipsoid WGS 84 at the origin (Farrell 2008,
Aided Navigation, eq. 2.5 and 2.6): below 70° of latitude they are off by 0.25 m at a distance of
1 km, and by the square of it beyond.
"""

from collections.abc import Callable
from math import cos, hypot, radians, sin, sqrt
from typing import Annotated

import msgspec

from messages import events, topics
from messages.events import Outbox
from messages.sensors import UsblSample
from messages.units import Ns

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
