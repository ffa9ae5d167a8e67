"""MAVLink frames to packets and back, by pymavlink."""

import importlib
from collections.abc import Iterable
from functools import cache
from typing import Any, Literal, NamedTuple

from messages import events
from messages.events import Outbox
from services.mavlink_io.framing import FrameCutter, header_of
from services.mavlink_io.numbers import AUTOPILOT
from services.mavlink_io.packet import MavlinkPacket
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install

Dialect = Literal["common", "ardupilotmega"]  # the second takes 35 MB more memory


class MavlinkCodec:
    """Encodes MAVLink 2 as one system and component, with numbered frames; decodes versions 1
    and 2.

    Attributes:
        types: pymavlink's class of each message, by its name.
    """

    def __init__(self, system: int, component: int, dialect: Dialect = "common") -> None:
        """
        Raises:
            LindyError: pymavlink is not installed.
        """
        module, self.types = _messages(dialect)
        self._mav: Any = module.MAVLink(None, srcSystem=system, srcComponent=component)

    def encode(self, packet: MavlinkPacket) -> bytes:
        """
        Raises:
            struct.error: a number does not fit its field.
        """
        fields = packet.fields
        if texts := [name for name, value in fields.items() if isinstance(value, str)]:
            fields = fields | {name: fields[name].encode() for name in texts}
        data = self.types[packet.name](**fields).pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        return bytes(data)

    def decode(self, frame: bytes, link: str = "") -> MavlinkPacket | None:
        """None for a frame with a wrong check sum. A message of another dialect has no fields."""
        try:
            message = self._mav.decode(bytearray(frame))
        except Exception:  # whatever a frame contains, it must not end the service
            return None
        name: str = message.get_type()
        known = name in self.types
        fields = {f: getattr(message, f) for f in message.get_fieldnames()} if known else {}
        return MavlinkPacket(
            name, fields, message.get_srcSystem(), message.get_srcComponent(), link
        )


@cache
def _messages(dialect: Dialect) -> tuple[Any, dict[str, Any]]:
    try:
        module: Any = importlib.import_module(f"pymavlink.dialects.v20.{dialect}")
    except ImportError:
        raise LindyError(
            f"MAVLink needs pymavlink, which is not installed; {how_to_install('mavlink')}"
        ) from None
    return module, {kind.msgname: kind for kind in module.mavlink_map.values()}


MOST = 100  # frames decoded at once: more than half a second of the telemetry that is asked for
STICKS = (69, 70)  # MANUAL_CONTROL, RC_CHANNELS_OVERRIDE: of a flood the newest is never left out


class HeardMessages(NamedTuple):
    """Of a board that sends much that nobody asked for, only these messages are decoded."""

    system: int
    messages: Iterable[str]


class FrameReader:
    """Packets from what arrives over one link. The outbox is told of each read with bytes outside
    of frames, of frames with a wrong check sum, and of the oldest frames of a flood, which are left
    out: of sticks, only those that are not the sender's newest."""

    def __init__(
        self, codec: MavlinkCodec, outbox: Outbox | None = None, heard: HeardMessages | None = None
    ) -> None:
        self._outbox = outbox or Outbox()
        self._codec, self._cutter = codec, FrameCutter()
        self._board = heard.system if heard else 0
        self._heard = {codec.types[name].id for name in heard.messages} if heard else set[int]()

    def read(
        self, pieces: Iterable[bytes], *, datagrams: bool = False, link: str = ""
    ) -> list[MavlinkPacket]:
        frames, garbage = self._cutter.frames(pieces, datagrams=datagrams)
        heard = [frame for frame in frames if self._is_heard(frame)]
        kept = heard if len(heard) <= MOST else _newest(heard)
        packets = [self._codec.decode(frame, link) for frame in kept]
        good = [packet for packet in packets if packet is not None]
        # What a board's boot loader says is one message that nobody can read, not one per byte.
        bad = bool(garbage) + len(kept) - len(good)
        self._outbox.tell(events.MALFORMED("mavlink"), bad)
        self._outbox.tell(events.OVERFLOWED("mavlink"), len(heard) - len(kept))
        return good

    def _is_heard(self, frame: bytes) -> bool:
        if not self._board:
            return True
        *sender, message = header_of(frame)
        return sender != [self._board, AUTOPILOT] or message in self._heard


def _newest(frames: list[bytes]) -> list[bytes]:
    """As many as there may be at most, in order; and of sticks the newest of each sender, too."""
    old, new = frames[:-MOST], frames[-MOST:]
    newest = {header: frame for frame in old if (header := header_of(frame))[2] in STICKS}
    since = {header_of(frame) for frame in new}
    spared = [frame for header, frame in newest.items() if header not in since]
    return spared[-MOST:] + new
