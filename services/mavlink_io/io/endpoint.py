"""MAVLink's packets over links: each other end has frames of its own, numbered and cut on their
own. The only place that knows pymavlink."""

import importlib
import struct
from collections.abc import Iterable
from functools import cache
from typing import Any, Literal, NamedTuple

from messages import events
from messages.events import Outbox
from services.mavlink_io.io.links import ByteLinks
from services.mavlink_io.packet import AUTOPILOT, MavlinkPacket
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install

V1, V2 = 0xFE, 0xFD  # first byte of a frame
HEAD = {V1: 8, V2: 12}  # [bytes] of a frame without payload: header and check sum
SIGNED, SIGNATURE = 1, 13  # bit of the third byte, and what it adds [bytes]
LONGEST = 280  # [bytes] of any frame


def header_of(frame: bytes) -> tuple[int, int, int]:
    """System, component and message of a whole frame, its check sum not yet verified."""
    if frame[0] == V1:
        return frame[3], frame[4], frame[5]
    return frame[5], frame[6], int.from_bytes(frame[7:10], "little")


class FrameCutter:
    """Keeps the rest of an incomplete frame; never more than one frame."""

    def __init__(self) -> None:
        self._rest = b""

    def frames(
        self, pieces: Iterable[bytes], *, datagrams: bool = False
    ) -> tuple[list[bytes], int]:
        """Candidates in order, their check sums not yet verified, and the bytes outside of them.

        Args:
            pieces: of a stream, cut anywhere. Datagrams hold whole frames, or go on with the last
                one: where one begins like a frame, the rest before it has no sequel.
        """
        found, garbage = list[bytes](), 0
        for piece in pieces if datagrams else (b"".join(pieces),):
            if datagrams and piece[:1] and piece[0] in HEAD:
                garbage, self._rest = garbage + len(self._rest), b""
            garbage += self._cut(self._rest + piece, found)
        return found, garbage

    def _cut(self, data: bytes, found: list[bytes]) -> int:
        """Adds the frames in `data`, and returns how many bytes are outside of them."""
        at = garbage = 0
        while at < len(data):
            if data[at] not in HEAD:
                starts = [begin for first in HEAD if (begin := data.find(first, at)) >= 0]
                begin = min(starts, default=len(data))
                garbage, at = garbage + begin - at, begin
                continue
            length = _length(data, at)
            if length is None or at + length > len(data):
                break
            found.append(data[at : at + length])
            at += length
        self._rest = data[at:]
        return garbage


def _length(data: bytes, at: int) -> int | None:
    """[bytes] Of the frame that begins here; None when too little of it is there."""
    if len(data) < at + 3:
        return None
    signed = data[at] == V2 and data[at + 2] & SIGNED
    return HEAD[data[at]] + data[at + 1] + (SIGNATURE if signed else 0)


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
    """Decode only these messages of a board, which sends many that Lindy does not ask for."""

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
        self._ends: dict[str, tuple[MavlinkCodec, FrameReader]] = {}
        self._new()  # whatever is missing is missed at once

    @property
    def names(self) -> list[str]:
        """Names of the other ends."""
        return self._links.names

    def receive(self) -> list[MavlinkPacket]:
        """Everything that has arrived since."""
        return [
            packet
            for link, pieces, datagrams in self._links.receive()
            for packet in self._end(link)[1].read(pieces, datagrams=datagrams, link=link)
        ]

    def send(self, packet: MavlinkPacket, link: str | None = None) -> None:
        """To one other end, or to all of them."""
        for name in self.names if link is None else [link]:
            try:
                frame = self._end(name)[0].encode(packet)
            except (struct.error, OverflowError):
                self._outbox.tell(events.DOES_NOT_FIT(packet.name))
            else:
                self._links.send(name, frame)

    def _end(self, link: str) -> tuple[MavlinkCodec, FrameReader]:
        if link not in self._ends:
            present = set(self.names)
            self._ends = {name: end for name, end in self._ends.items() if name in present}
            self._ends[link] = self._new()
        return self._ends[link]

    def _new(self) -> tuple[MavlinkCodec, FrameReader]:
        codec = MavlinkCodec(*self._ids, self._dialect)
        return codec, FrameReader(codec, self._outbox, self._heard)
