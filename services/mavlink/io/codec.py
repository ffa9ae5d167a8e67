"""Packets to frames and back, for one link, by pymavlink."""

import struct
from collections import Counter
from typing import Any

from services.mavlink.numbers import AUTOPILOT_COMPONENT
from services.mavlink.packets import GroundStation, MavPacket, ReceivedPacket
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install

try:
    from pymavlink.dialects.v20 import (  # pyright: ignore[reportMissingTypeStubs]
        ardupilotmega as dialect,
    )
except ImportError:
    raise LindyError(f"ground stations need pymavlink: {how_to_install('mavlink')}") from None

CLASSES: dict[str, Any] = {kind.msgname: kind for kind in dialect.mavlink_map.values()}


class Codec:
    """Numbers the frames of one link; frames may arrive in pieces."""

    def __init__(self, link: str, system: int, counts: Counter[str]) -> None:
        self._link = link
        self._counts = counts
        self._mav = dialect.MAVLink(None, srcSystem=system, srcComponent=AUTOPILOT_COMPONENT)
        self._mav.robust_parsing = True  # rubbish becomes a message of the type BAD_DATA

    def encode(self, packet: MavPacket) -> bytes | None:
        """The frame; None, and counted, where a number does not fit its field."""
        try:
            frame = bytes(CLASSES[packet.name](**packet.fields).pack(self._mav))
        except (struct.error, OverflowError):
            self._counts[f"does_not_fit:{packet.name}"] += 1
            return None
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame

    def decode(self, data: bytes, *, whole: bool) -> list[ReceivedPacket]:
        """The packets in what arrived; rubbish is counted.

        Args:
            whole: a datagram. What is cut off at its end has no sequel.
        """
        mav, found = self._mav, list[ReceivedPacket]()
        rest = data
        while (message := self._next(rest)) is not None:
            rest = b""
            if isinstance(message, dialect.MAVLink_bad_data | dialect.MAVLink_unknown):
                self._counts["malformed:mavlink"] += 1
                continue
            fields = {name: getattr(message, name) for name in message.get_fieldnames()}
            station = GroundStation(self._link, message.get_srcSystem(), message.get_srcComponent())
            found.append(ReceivedPacket(station, message.get_type(), fields))
        mav.buf, mav.buf_index = mav.buf[mav.buf_index :], 0  # it keeps what it has read
        if whole and mav.buf:
            self._counts["malformed:mavlink"] += 1
            mav.buf = bytearray()
        return found

    def _next(self, data: bytes) -> Any:
        """The next message of the parser, which may raise on text that is none."""
        while True:
            try:
                return self._mav.parse_char(data)
            except Exception:  # whatever a frame contains, it must not end the service
                self._counts["malformed:mavlink"] += 1
                data = b""
