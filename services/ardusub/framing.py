"""Where MAVLink frames begin and end in a stream of bytes."""

from typing import NamedTuple

V1, V2 = 0xFE, 0xFD  # first byte of a frame
HEAD = {V1: 8, V2: 12}  # [bytes] of a frame without payload: header and check sum
SIGNED, SIGNATURE = 1, 13  # bit of the third byte, and what it adds [bytes]
LONGEST = 280  # [bytes] of any frame


class FrameHeader(NamedTuple):
    system: int
    component: int
    message: int


def header_of(frame: bytes) -> FrameHeader:
    """What a whole frame says about itself, its check sum not yet verified."""
    if frame[0] == V1:
        return FrameHeader(*frame[3:6])
    return FrameHeader(frame[5], frame[6], int.from_bytes(frame[7:10], "little"))


class FrameCutter:
    """Keeps the rest of an incomplete frame; never more than one frame."""

    def __init__(self) -> None:
        self._rest = b""

    def frames(self, data: bytes) -> tuple[list[bytes], int]:
        """Candidates in order, their check sums not yet verified, and the bytes outside of them."""
        data, found, at, garbage = self._rest + data, list[bytes](), 0, 0
        while at < len(data):
            if data[at] not in HEAD:
                begin = _next_start(data, at)
                garbage, at = garbage + begin - at, begin
                continue
            length = _length(data, at)
            if length is None or at + length > len(data):
                break
            found.append(data[at : at + length])
            at += length
        self._rest = data[at:][:LONGEST]
        return found, garbage


def _next_start(data: bytes, at: int) -> int:
    starts = [begin for first in HEAD if (begin := data.find(first, at)) >= 0]
    return min(starts, default=len(data))


def _length(data: bytes, at: int) -> int | None:
    """[bytes] Of the frame that begins here; None when too little of it is there."""
    if len(data) < at + 3:
        return None
    signed = data[at] == V2 and data[at + 2] & SIGNED
    return HEAD[data[at]] + data[at + 1] + (SIGNATURE if signed else 0)
