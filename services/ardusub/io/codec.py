"""MAVLink frames to packets and back, by pymavlink."""

import importlib
from collections.abc import Iterable
from typing import Any, NamedTuple, cast

from services.ardusub.framing import FrameCutter, header_of
from services.ardusub.packet import AUTOPILOT, MavlinkPacket
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install


class BoardCodec:
    """Encodes MAVLink 2 as one system and component; decodes versions 1 and 2.

    The common dialect has all that is used; ArduPilot's own takes 35 MB more memory.
    """

    def __init__(self, system: int, component: int) -> None:
        """
        Raises:
            LindyError: pymavlink is not installed.
        """
        try:
            dialect = cast(Any, importlib.import_module("pymavlink.dialects.v20.common"))
        except ImportError:
            raise LindyError(
                f"ArduSub is reached by MAVLink: pymavlink is missing; {how_to_install('mavlink')}"
            ) from None
        self._mav = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self._wrong = dialect.MAVError
        self._types = {kind.msgname: kind for kind in dialect.mavlink_map.values()}

    def number(self, name: str) -> int:
        """The message's id."""
        return self._types[name].id

    def encode(self, packet: MavlinkPacket) -> bytes:
        fields = {
            name: value.encode() if isinstance(value, str) else value
            for name, value in packet.fields.items()
        }
        data = self._types[packet.name](**fields).pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        return bytes(data)

    def numbers(self, names: Iterable[str]) -> frozenset[int]:
        """Ids of messages."""
        return frozenset(self.number(name) for name in names)

    def decode(self, frame: bytes) -> MavlinkPacket | None:
        """None for a frame with a wrong check sum. A message of another dialect has no fields."""
        try:
            message = self._mav.decode(bytearray(frame))
        except (self._wrong, ValueError, IndexError):
            return None
        name: str = message.get_type()
        known = name in self._types
        fields = {f: getattr(message, f) for f in message.get_fieldnames()} if known else {}
        return MavlinkPacket(name, fields, message.get_srcSystem(), message.get_srcComponent())


MOST = 200  # frames decoded at once: a second of the telemetry that is asked for


class ReadFrames(NamedTuple):
    packets: list[MavlinkPacket]
    wrong: int  # bytes outside of frames, and frames that are none
    left_out: int  # frames of a flood: the oldest


class FrameReader:
    """Packets from a stream of bytes, with what was wrong with the others counted."""

    def __init__(self, codec: BoardCodec, board: int = 0, heard: Iterable[str] = ()) -> None:
        """
        Args:
            board: system whose autopilot sends much that nobody asked for: of its frames only the
                messages `heard` are decoded. 0: everything is.
        """
        self._codec, self._framing = codec, FrameCutter()
        self._board, self._heard = board, codec.numbers(heard)

    def read(self, data: bytes) -> ReadFrames:
        frames, garbage = self._framing.frames(data)
        kept = [frame for frame in frames[-MOST:] if self._is_heard(frame)]
        packets = [self._codec.decode(frame) for frame in kept]
        good = [packet for packet in packets if packet is not None]
        return ReadFrames(good, garbage + len(kept) - len(good), max(0, len(frames) - MOST))

    def _is_heard(self, frame: bytes) -> bool:
        header = header_of(frame)
        of_board = (header.system, header.component) == (self._board, AUTOPILOT)
        return not of_board or header.message in self._heard
