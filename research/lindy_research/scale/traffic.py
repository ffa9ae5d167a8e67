"""What one drone and its pilot send through a network, by the topic table. Pure."""

from collections.abc import Iterable
from typing import NamedTuple

import msgspec

from messages.topic import Side
from messages.topics import THIN_HZ
from tests.support.synthetic import ASKED, SyntheticStream, said_by
from tools.fleet.look import ROWS

OTHER: dict[Side, Side] = {"drone": "topside", "topside": "drone"}
HASH = "0123456789abcdef"


class FleetTraffic(NamedTuple):
    """Of one drone, in one direction."""

    messages_hz: float  # [1/s]
    payload_hz: float  # [bytes/s] without Zenoh's part

    def __add__(self, other: object) -> "FleetTraffic":
        assert isinstance(other, FleetTraffic)
        return FleetTraffic(
            self.messages_hz + other.messages_hz, self.payload_hz + other.payload_hz
        )

    def times(self, count: float) -> "FleetTraffic":
        return FleetTraffic(count * self.messages_hz, count * self.payload_hz)


NONE = FleetTraffic(0.0, 0.0)


def flown(side: Side, *, thinned: bool = False) -> FleetTraffic:
    """What this side says to the other one while a pilot flies.

    Args:
        thinned: to a link with little room, as `downsampling` in deploy/router.json5 does.
    """
    asked = _asked(side)
    return _sum(map(_thinned, asked) if thinned else asked)


def watched() -> FleetTraffic:
    """What a drone says to whoever watches all of them, as `lindy drones --watch` does."""
    rows = {topic.key for topic in ROWS}
    return _sum(s for s in said_by("drone", "x", messages=HASH) if _row(s) in rows)


def _asked(side: Side) -> list[SyntheticStream]:
    asked = ASKED[OTHER[side]]
    return [s for s in said_by(side, "x", messages=HASH) if any(t.covers(_row(s)) for t in asked)]


def _thinned(stream: SyntheticStream) -> SyntheticStream:
    return stream._replace(hz=min(stream.hz, THIN_HZ))


def _row(stream: SyntheticStream) -> str:
    """Its key within the drone's namespace."""
    return stream.topic.key.split("/", 3)[3]


def _sum(streams: Iterable[SyntheticStream]) -> FleetTraffic:
    found = NONE
    for stream in streams:
        size = len(msgspec.msgpack.encode(stream.example))
        found += FleetTraffic(stream.hz, stream.hz * size)
    return found
