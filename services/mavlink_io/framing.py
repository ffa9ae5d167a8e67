"""Where MAVLink frames begin and end in what arrives."""

from collections.abc import Iterable

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
