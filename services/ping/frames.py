"""Frames of the Ping protocol: `BR`, numbers little-endian, the sum of all bytes at the end.

From Blue Robotics' pages docs/index.md and src/definitions/{common,ping1d}.json in
github.com/bluerobotics/ping-protocol.
"""

import struct
from collections.abc import Iterable
from functools import reduce
from operator import add
from typing import NamedTuple

NACK, DEVICE, REQUEST = 2, 4, 6
SET_SPEED_OF_SOUND, SET_PING_ENABLE, DISTANCE, PROFILE = 1002, 1006, 1212, 1300
START = b"BR"
HEAD = struct.Struct("<2sHHBB")  # start, length of the payload, message, sender, receiver
SUM = struct.Struct("<H")
LONGEST = 300  # [bytes] of a payload; a profile has about 230
# Distance [mm], confidence [%], pulse [µs], number of the ping, start and length of the scan [mm],
# gain. A profile begins with the same, and its echo follows.
ECHO = struct.Struct("<IHHIIII")


class PingEcho(NamedTuple):
    distance: float  # [m]
    confidence: int  # [%]
    number: int  # of the ping, since it was powered


def frame(message: int, payload: bytes) -> bytes:
    data = HEAD.pack(START, len(payload), message, 0, 0) + payload
    return data + SUM.pack(_sum(data))


def request(message: int) -> bytes:
    """Asks for one message."""
    return frame(REQUEST, SUM.pack(message))


def echo_of(payload: bytes) -> PingEcho | None:
    """None: it is too short."""
    if len(payload) < ECHO.size:
        return None
    distance, confidence, _, number, *_ = ECHO.unpack_from(payload)
    return PingEcho(distance / 1000.0, confidence, number)


def firmware_of(payload: bytes) -> str | None:
    """None: it is too short."""
    return "firmware {}.{}.{}".format(*payload[2:5]) if len(payload) >= 5 else None


def nack_of(payload: bytes) -> tuple[int, str]:
    """The message that is refused, and why."""
    return int.from_bytes(payload[:2], "little"), payload[2:202].decode("ascii", "replace")


class PingCutter:
    """Keeps the rest of an unfinished frame; never more than one."""

    def __init__(self) -> None:
        self._rest = b""

    def frames(self, pieces: Iterable[bytes]) -> tuple[list[tuple[int, bytes]], bool]:
        """Messages with their payloads, in order; and whether anything else arrived."""
        data, at, garbage = self._rest + b"".join(pieces), 0, False
        found = list[tuple[int, bytes]]()
        while (begin := data.find(START, at)) >= 0:
            garbage |= begin > at
            at = begin
            if len(data) - at < HEAD.size:
                break
            _, length, message, _, _ = HEAD.unpack_from(data, at)
            end = at + HEAD.size + length
            if length <= LONGEST and len(data) < end + SUM.size:
                break
            if length > LONGEST or SUM.unpack_from(data, end) != (_sum(data[at:end]),):
                garbage, at = True, at + len(START)
                continue
            found.append((message, data[at + HEAD.size : end]))
            at = end + SUM.size
        else:
            half = data.endswith(START[:1]) and at < len(data)
            garbage |= len(data) - half > at
            at = len(data) - half
        self._rest = data[at:]
        return found, garbage


def _sum(data: bytes) -> int:
    return reduce(add, data, 0) & 0xFFFF
