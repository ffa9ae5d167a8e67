"""Telemetry logs of a ground station (.tlog): UTC in microseconds before each MAVLink packet."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.importing.dataflash_file import is_dataflash
from tools.importing.log_file import LogRow, LogSource, Wanted, getter

STAMP = 8  # [bytes] big-endian, before each packet
V1, V2 = 0xFE, 0xFD  # first byte of a packet
LONGEST = STAMP + 12 + 255 + 13  # [bytes]
BLOCK = 1 << 20  # [bytes] that are read at once
SIGNED = 0x01
ARDUPILOT, SUBMARINE = 3, 12  # of a heartbeat
FROM_OTHERS = ("MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE")  # what a ground station sends
EARLIEST_US, LATEST_US = 0, 4_102_444_800_000_000  # [µs] UTC of a stamp; a packet has one before it


class LoggedPacket(NamedTuple):
    at_us: int  # [µs] UTC
    number: int  # of the kind of message
    system: int
    data: bytes


def is_tlog(path: Path) -> bool:
    """By its name, and where it has that of a DataFlash log by its beginning."""
    if path.suffix.lower() == ".bin" and path.is_file():
        with path.open("rb") as file:
            return file.read(STAMP + 1)[STAMP:] in (bytes([V1]), bytes([V2]))
    return path.suffix.lower() == ".tlog" and not is_dataflash(path)


class TlogFile:
    """One log. Of several systems that talk in it, the vehicle's messages are taken, and the
    sticks of a ground station."""

    default_map = "ardusub"
    getter = staticmethod(getter)

    def __init__(self, path: Path) -> None:
        """
        Raises:
            LindyError: pymavlink is not installed, or it is no such log.
        """
        self.remarks: list[str] = []
        self._path = path
        try:
            from pymavlink.dialects.v20 import (  # pyright: ignore[reportMissingTypeStubs]
                ardupilotmega,
            )
        except ModuleNotFoundError:
            raise LindyError(
                f"telemetry logs need pymavlink, which is missing: {how_to_install('import')}"
            ) from None
        self._mavlink: Any = ardupilotmega
        self._codec: Any = ardupilotmega.MAVLink(None)
        kinds: dict[int, Any] = ardupilotmega.mavlink_map
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
        numbers = {number for number, name in self._names.items() if name in wanted}
        damaged = 0
        for found in self._packets():
            if isinstance(found, int) or found.number not in numbers:
                continue
            name = self._names[found.number]
            if not self._is_taken(found.system, name):
                continue
            if (fields := self._decoded(found)) is not None:
                yield LogRow(name, fields, found.at_us * 1000)
            else:
                damaged += 1
        remark = f"{damaged} packets have a wrong checksum and are left out"
        if damaged and remark not in self.remarks:  # it is read more than once
            self.remarks.append(remark)

    def _is_taken(self, system: int, name: str) -> bool:
        return (system == self._vehicle) != (name in FROM_OTHERS)

    def _only_submarine(self, boards: dict[int, int]) -> int:
        """
        Raises:
            LindyError: there is none, or there are several.
        """
        if not boards:
            raise LindyError(
                f"{self._path} has no heartbeat of ArduPilot: it is no telemetry log, or the "
                f"vehicle was not connected"
            )
        if len(boards) > 1:
            named = " and ".join(str(system) for system in sorted(boards))
            raise LindyError(
                f"{self._path} is of two boards, systems {named}: one recording is of one vehicle; "
                f"record each in a log of its own"
            )
        ((system, kind),) = boards.items()
        if kind != SUBMARINE:
            raise LindyError(
                f"{self._path} is of a vehicle of MAVLink's type {kind}; expected {SUBMARINE}, a "
                f"submarine: another vehicle's axes and modes are not those of the map"
            )
        return system

    def _decoded(self, packet: LoggedPacket) -> Any:
        """None: it is damaged."""
        try:
            return self._codec.decode(bytearray(packet.data))
        except self._mavlink.MAVError:
            return None

    def _packets(self) -> Iterator[LoggedPacket | int]:
        """Packets, and how many bytes between them are none."""
        with self._path.open("rb") as file:
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
    if at + STAMP + 3 > len(buffer):
        return 0
    stamp = int.from_bytes(buffer[at : at + STAMP], "big")
    magic, payload, flags = buffer[at + STAMP : at + STAMP + 3]
    if not EARLIEST_US <= stamp <= LATEST_US:
        return 0
    if magic == V2:
        return 12 + payload + (13 if flags & SIGNED else 0)
    return 8 + payload if magic == V1 else 0
