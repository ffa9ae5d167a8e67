"""Packets over links: each other end has frames of its own, numbered and cut on their own."""

import struct
from typing import NamedTuple

from messages import events
from messages.events import Outbox
from services.mavlink_io.io.codec import Dialect, FrameReader, HeardMessages, MavlinkCodec
from services.mavlink_io.io.links import ByteLinks
from services.mavlink_io.packet import MavlinkPacket


class _OtherEnd(NamedTuple):
    codec: MavlinkCodec
    reader: FrameReader


class MavlinkEndpoint:
    """One system and component, speaking with all other ends of its links."""

    def __init__(
        self,
        links: ByteLinks,
        outbox: Outbox,
        system: int,
        component: int,
        dialect: Dialect = "common",
        heard: HeardMessages | None = None,
    ) -> None:
        """
        Raises:
            LindyError: pymavlink is not installed.
        """
        self._links, self._outbox = links, outbox
        self._ids, self._heard = (system, component), heard
        self._dialect: Dialect = dialect
        self._ends: dict[str, _OtherEnd] = {}
        self._new()  # whatever is missing is missed at once

    @property
    def names(self) -> list[str]:
        """Of the other ends."""
        return self._links.names

    def receive(self) -> list[MavlinkPacket]:
        """Everything that has arrived since."""
        return [
            packet
            for link, pieces, datagrams in self._links.receive()
            for packet in self._end(link).reader.read(pieces, datagrams=datagrams, link=link)
        ]

    def send(self, packet: MavlinkPacket, link: str | None = None) -> None:
        """To one other end, or to all of them."""
        for name in self.names if link is None else [link]:
            try:
                frame = self._end(name).codec.encode(packet)
            except (struct.error, OverflowError):
                self._outbox.tell(events.DOES_NOT_FIT(packet.name))
            else:
                self._links.send(name, frame)

    def _end(self, link: str) -> _OtherEnd:
        if link not in self._ends:
            present = set(self.names)
            self._ends = {name: end for name, end in self._ends.items() if name in present}
            self._ends[link] = self._new()
        return self._ends[link]

    def _new(self) -> _OtherEnd:
        codec = MavlinkCodec(*self._ids, self._dialect)
        return _OtherEnd(codec, FrameReader(codec, self._outbox, self._heard))
