"""Positions on the earth as fixes in metres, from an origin: a given one, or the first position."""

from collections.abc import Callable
from math import hypot

import msgspec

from messages import events, topics
from messages.events import Outbox
from messages.sensors import UsblSample
from messages.units import Ns
from services.instruments.geodesy import GeoPoint, is_on_earth, north_east

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
