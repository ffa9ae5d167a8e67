"""A MAVLink message by its name and fields, without its frame. Only io/ knows the frames."""

from collections.abc import Mapping
from typing import Any, NamedTuple


class MavPacket(NamedTuple):
    """To be sent."""

    name: str  # as in the dialect: ATTITUDE
    fields: Mapping[str, Any]


class GroundStation(NamedTuple):
    """Who sent a packet: a system and component id, at one end of one link."""

    link: str  # `tcp 127.0.0.1:40112`
    system: int
    component: int

    @property
    def pilot(self) -> str:
        """Its name as a pilot."""
        return f"ground station {self.system}/{self.component}"


class ReceivedPacket(NamedTuple):
    sender: GroundStation
    name: str
    fields: Mapping[str, Any]


class Addressed(NamedTuple):
    """A packet for one link, or for all of them."""

    link: str | None
    packet: MavPacket
