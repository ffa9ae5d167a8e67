"""Logs of ArduSub (.bin) and of a ground station (.tlog), by the library pymavlink."""

import contextlib
import io
import mmap
from array import array
from collections import Counter
from collections.abc import Iterator
from heapq import merge
from itertools import chain, pairwise, repeat
from pathlib import Path
from struct import calcsize, unpack
from typing import Any, NamedTuple

from messages.units import Ns
from services.runtime.config.errors import LindyError
from tools.importing.log_file import LogFile, LogRow, LogSource, Wanted, library

HEAD = b"\xa3\x95"
FMT = (128, "FMT", 89, "BBnNZ", "Type,Length,Name,Format,Columns")  # says what the others are
GPS_EPOCH_S, LEAP_S = 315_964_800, 18  # [s] of GPS time, and its seconds ahead of UTC since 2017
WEEK_S = 604_800
FIRMWARE = "ArduSub"
OTHERS = ("ArduCopter", "ArduPlane", "ArduRover", "Copter", "Plane", "Rover", "Blimp")
APART_NS = 1_000_000_000  # [ns] messages are out of order by less
SLACK = 528  # [bytes] some boards write whole pages: so much at the end may be nothing

STAMP = 8  # [bytes] big-endian, before each packet
V1, V2 = 0xFE, 0xFD  # first byte of a packet
LONGEST = STAMP + 12 + 255 + 13  # [bytes]
BLOCK = 1 << 20  # [bytes] that are read at once
SIGNED = 0x01
ARDUPILOT = 3  # of a heartbeat
FROM_OTHERS = ("MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE")  # what a ground station sends
LATEST_US = 4_102_444_800_000_000  # [µs] UTC of a stamp; a packet has one before it


class DataflashFile(LogFile):
    """One log. A message of one of several sensors is called as `BARO[1]`."""

    default_map = "ardusub"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.refuse_other(HEAD, "a DataFlash log")
        self._pymavlink = library("pymavlink.DFReader", "logs of ArduSub")
        with path.open("rb") as file:
            self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._formats: dict[int, Any] = {FMT[0]: self._pymavlink.DFFormat(*FMT)}
        self._at_bytes: dict[int, array[int]] = {}  # places of messages, by number of the format
        self._indexed()
        self._places = self._by_source()
        self._require_ardusub()
        self._utc_ns = self._utc_of_start()

    def sources(self) -> dict[str, LogSource]:
        return {name: LogSource(name, len(at)) for name, (_, at) in self._places.items()}

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        """A message whose time is beyond those of the two beside it has a damaged one."""
        before: LogRow | None = None
        left_out = 0
        for row, after in pairwise(chain(self._all(wanted), [None])):
            assert row is not None
            if before is not None and after is not None:
                least, most = sorted((before.arrival_ns, after.arrival_ns))
                if not least - APART_NS <= row.arrival_ns <= most + APART_NS:
                    left_out += 1
                    continue
            yield row
            before = row
        if left_out:
            self.remarks.append(f"messages with a damaged time, left out: {left_out}")

    def _all(self, wanted: Wanted) -> Iterator[LogRow]:
        named = [
            zip(places, repeat(name), repeat(kind), strict=False)
            for name, (kind, places) in self._places.items()
            if name in wanted
        ]
        for place, name, kind in merge(*named):
            fields = self._message(kind, place)
            yield LogRow(name, fields, self._utc_ns + int(fields.TimeUS) * 1000)

    def _indexed(self) -> None:
        """Find every whole message, whatever is damaged between them."""
        data, end = self._data, 0
        skipped, at = 0, 0
        while at + 3 <= len(data):
            kind = data[at + 2]
            form = self._formats.get(kind) if data[at : at + 2] == HEAD else None
            if form is None or not self._is_followed(at + form.len):
                after = data.find(HEAD, at + 1)
                after = len(data) if after < 0 else after
                skipped += after - at if after < len(data) else 0
                at = after
                continue
            if at + form.len > len(data):
                break
            self._at_bytes.setdefault(kind, array("Q")).append(at)
            if form.name in ("FMT", "FMTU"):
                self._learn(form, self._message(kind, at))
            at = end = at + form.len
        if skipped:
            self.remarks.append(f"{skipped} bytes between its messages are damaged")
        if (left := len(data) - end) > SLACK:
            self.remarks.append(f"its last {left} bytes are no whole message: it was cut off")

    def _is_followed(self, end: int) -> bool:
        """By another message, or by none any more: else what ends there is damage that looked like
        one."""
        return self._data[end : end + 2] == HEAD or self._data.find(HEAD, end) < 0

    def _learn(self, form: Any, said: Any) -> None:
        """A format, or which of its fields is the number of the sensor."""
        try:
            if form.name == "FMT" and said.Type != FMT[0]:
                letters, names = said.Format, said.Columns
                with contextlib.redirect_stdout(io.StringIO()):  # of a damaged one it says so
                    new = self._pymavlink.DFFormat(
                        said.Type, said.Name, said.Length, letters, names
                    )
                whole = 3 + calcsize(new.msg_struct) == new.len
                if whole and len(new.columns) == len(new.msg_fmts):
                    self._formats[said.Type] = new
            elif form.name == "FMTU" and said.FmtType in self._formats:
                self._formats[said.FmtType].set_unit_ids(said.UnitIds, {})
        except Exception:  # of whatever kind: pymavlink does not say
            self.remarks.append(f"one of its {form.name} is damaged")

    def _by_source(self) -> "dict[str, tuple[int, array[int]]]":
        """Number of the format and places [bytes] of every whole message, by name."""
        found: dict[str, tuple[int, array[int]]] = {}
        for kind, places in self._at_bytes.items():
            form = self._formats[kind]
            if "TimeUS" not in form.columns:
                continue
            if form.instance_field is None or form.instance_len != 1:
                found[form.name] = (kind, places)
                continue
            inside = 3 + form.instance_ofs
            for at in places:
                name = f"{form.name}[{self._data[at + inside]}]"
                found.setdefault(name, (kind, array("Q")))[1].append(at)
        return found

    def _message(self, kind: int, at: int) -> Any:
        """The message at a place."""
        form = self._formats[kind]
        numbers = unpack(form.msg_struct, self._data[at + 3 : at + form.len])
        return self._pymavlink.DFMessage(form, numbers, True, None)

    def _require_ardusub(self) -> None:
        kind, places = self._places.get("MSG", (0, array("Q")))
        texts = [str(getattr(self._message(kind, at), "Message", "")) for at in places[:100]]
        named = [text for text in texts if text.startswith((FIRMWARE, *OTHERS))]
        if named and not named[0].startswith(FIRMWARE):
            raise LindyError(
                f"{self.path} is of {named[0]}; expected a log of {FIRMWARE}: another vehicle's "
                f"axes, modes and sensors are not those of the map"
            )

    def _utc_of_start(self) -> Ns:
        """[ns] UTC when the board's clock began."""
        for name in ("GPS[0]", "GPS"):
            kind, places = self._places.get(name, (0, array("Q")))
            for place in places:
                fields = self._message(kind, place)
                if getattr(fields, "GWk", 0) > 0:
                    seconds = GPS_EPOCH_S + int(fields.GWk) * WEEK_S - LEAP_S
                    return seconds * 10**9 + int(fields.GMS) * 10**6 - int(fields.TimeUS) * 1000
        every = (self._message(k, at[-1]).TimeUS for k, at in self._places.values() if at)
        return self.began_by_file(int(max(every, default=0)) * 1000)


class LoggedPacket(NamedTuple):
    at_us: int  # [µs] UTC
    number: int  # of the kind of message
    system: int
    data: bytes


class TlogFile(LogFile):
    """UTC in microseconds before each MAVLink packet. Of several systems that talk in it, the
    vehicle's messages are taken, and the sticks of a ground station."""

    default_map = "ardusub"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._mavlink = library("pymavlink.dialects.v20.ardupilotmega", "telemetry logs")
        self._codec: Any = self._mavlink.MAVLink(None)
        kinds: dict[int, Any] = self._mavlink.mavlink_map
        self._names = {number: str(kind.msgname) for number, kind in kinds.items()}
        self._vehicle = 0  # number of the system

    def sources(self) -> dict[str, LogSource]:
        counts: Counter[tuple[int, int]] = Counter()  # system, number
        boards: dict[int, int] = {}  # system → type of vehicle
        skipped = damaged = 0
        heartbeat = self._mavlink.MAVLINK_MSG_ID_HEARTBEAT
        for found in self._packets():
            if isinstance(found, int):
                skipped += found
                continue
            counts[found.system, found.number] += 1
            beat = self._decoded(found) if found.number == heartbeat else None
            damaged += found.number == heartbeat and beat is None
            if beat is not None and beat.autopilot == ARDUPILOT:
                boards[found.system] = beat.type
        self._vehicle = self._only_submarine(boards)
        if skipped or damaged:
            self.remarks.append(
                f"{skipped} bytes of it are no packet, and {damaged} heartbeats are damaged"
            )
        sources: dict[str, LogSource] = {}
        for (system, number), count in counts.items():
            name = self._names.get(number, f"message {number}")
            if self._is_taken(system, name):
                before = sources[name].messages if name in sources else 0
                sources[name] = LogSource(name, before + count)
        return sources

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        damaged = 0
        for found in self._packets():
            name = "" if isinstance(found, int) else self._names.get(found.number, "")
            if isinstance(found, int) or name not in wanted:
                continue
            if self._is_taken(found.system, name):
                if (fields := self._decoded(found)) is not None:
                    yield LogRow(name, fields, found.at_us * 1000)
                else:
                    damaged += 1
        if damaged:
            self.remarks.append(f"{damaged} packets have a wrong checksum and are left out")

    def _is_taken(self, system: int, name: str) -> bool:
        return (system == self._vehicle) != (name in FROM_OTHERS)

    def _only_submarine(self, boards: dict[int, int]) -> int:
        """
        Raises:
            LindyError: there is none, or there are several.
        """
        if not boards:
            raise LindyError(
                f"{self.path} has no heartbeat of ArduPilot: it is no telemetry log, or the "
                f"vehicle was not connected"
            )
        if len(boards) > 1:
            named = " and ".join(str(system) for system in sorted(boards))
            raise LindyError(
                f"{self.path} is of two boards, systems {named}: one recording is of one vehicle; "
                f"record each in a log of its own"
            )
        ((system, kind),) = boards.items()
        self.require_submarine(kind)
        return system

    def _decoded(self, packet: LoggedPacket) -> Any:
        """None: it is damaged."""
        try:
            return self._codec.decode(bytearray(packet.data))
        except self._mavlink.MAVError:
            return None

    def _packets(self) -> Iterator[LoggedPacket | int]:
        """Packets, and how many bytes between them are none."""
        with self.path.open("rb") as file:
            buffer, at = b"", 0
            while True:
                if len(buffer) - at < LONGEST:
                    buffer, at = buffer[at:] + file.read(BLOCK), 0
                if len(buffer) < STAMP + 3:
                    return
                length = _length(buffer, at)
                if length == 0 or at + STAMP + length > len(buffer):
                    if at + STAMP + 3 >= len(buffer):
                        return
                    at += 1
                    yield 1
                    continue
                data = buffer[at + STAMP : at + STAMP + length]
                stamp = int.from_bytes(buffer[at : at + STAMP], "big")
                at += STAMP + length
                if data[0] == V2:
                    yield LoggedPacket(stamp, int.from_bytes(data[7:10], "little"), data[5], data)
                else:
                    yield LoggedPacket(stamp, data[5], data[3], data)


def _length(buffer: bytes, at: int) -> int:
    """[bytes] Of the packet behind the stamp at this place; 0: there is none."""
    stamp = int.from_bytes(buffer[at : at + STAMP], "big")
    if at + STAMP + 3 > len(buffer) or stamp > LATEST_US:
        return 0
    magic, payload, flags = buffer[at + STAMP : at + STAMP + 3]
    if magic == V2:
        return 12 + payload + (13 if flags & SIGNED else 0)
    return 8 + payload if magic == V1 else 0
