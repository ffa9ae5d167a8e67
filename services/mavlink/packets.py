"""Packets of ground stations: from whom, and for whom."""

from typing import Any, NamedTuple

from services.mavlink_io.packet import MavlinkPacket


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
    fields: dict[str, Any]


class Addressed(NamedTuple):
    """A packet for one link, or for all of them."""

    link: str | None
    packet: MavlinkPacket


def received(packet: MavlinkPacket) -> ReceivedPacket:
    sender = GroundStation(packet.link, packet.system, packet.component)
    return ReceivedPacket(sender, packet.name, packet.fields)
