"""What the end of an MCAP file says of the rest: where its chunks and its other records begin, its
channels, and how many messages it has. https://mcap.dev/spec
"""

import struct
import zlib
from bisect import bisect_right
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from services.recorder.io.open_chunk import MAGIC

# What reading a truncated or damaged file raises; a damaged length can exhaust the memory.
DAMAGE = (McapError, struct.error, zstandard.ZstdError, ValueError, OverflowError, MemoryError)
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
FOOTER = struct.Struct("<BQQQI")  # opcode, length, starts of the summary and its offsets, checksum
CHECKSUM = 4  # [bytes]
DATA_END = RECORD_HEAD.size + CHECKSUM  # [bytes]; it is directly before the summary
CHUNK_INDEX = struct.Struct("<QQQQI")  # log times, where the chunk begins, its length, a map's …
INDEX_LENGTH = struct.Struct("<Q")  # … [bytes] behind which is that of the message indices
WHERE = struct.Struct("<Q")  # how an index of an attachment or of metadata begins
STATISTICS = struct.Struct("<Q")  # how they begin: number of messages


@dataclass
class FileIndex:
    """Empty where the file has no summary, or a damaged one."""

    ended: bool = False  # the file has an end, with or without a summary
    damaged_at: int | None = None  # [bytes] where the summary begins that cannot be read
    messages: int | None = None  # that the file says it has
    opcodes: dict[int, int] = field(default_factory=dict[int, int])  # of records, by position
    indices: dict[int, int] = field(default_factory=dict[int, int])  # [bytes] behind each chunk
    described: list[Schema | Channel] = field(default_factory=list[Schema | Channel])

    @cached_property
    def starts(self) -> list[int]:
        """[bytes] Where the known records begin."""
        return sorted(self.opcodes)

    @cached_property
    def has_chunks(self) -> bool:
        return Opcode.CHUNK in self.opcodes.values()

    def following(self, position: int) -> int | None:
        """[bytes] Where the next known record begins."""
        place = bisect_right(self.starts, position)
        return self.starts[place] if place < len(self.starts) else None


def index_of(stream: BinaryIO, size: int) -> FileIndex:
    """
    Args:
        size: [bytes] of the file.
    """
    at = size - FOOTER.size - len(MAGIC)
    if at < len(MAGIC):
        return FileIndex()
    stream.seek(at)
    tail = stream.read()
    if not tail.endswith(MAGIC):
        return FileIndex()
    opcode, _, start, _, checksum = FOOTER.unpack_from(tail)
    if opcode == Opcode.FOOTER and start == 0:
        return FileIndex(ended=True)  # without a summary
    if opcode == Opcode.FOOTER and len(MAGIC) + DATA_END <= start <= at:
        stream.seek(start)
        summary = stream.read(at - start)
        checked = summary + tail[: FOOTER.size - CHECKSUM]
        with suppress(*DAMAGE):
            if checksum in (0, zlib.crc32(checked)):
                return _read(summary, start)
    return FileIndex(ended=True, damaged_at=at)


def _read(summary: bytes, start: int) -> FileIndex:
    """
    Raises:
        DAMAGE: it makes no sense.
    """
    found = FileIndex(ended=True, opcodes={start - DATA_END: Opcode.DATA_END})
    at = 0
    while at < len(summary):
        opcode, length = RECORD_HEAD.unpack_from(summary, at)
        at += RECORD_HEAD.size
        content = summary[at : at + length]
        if len(content) < length:
            raise ValueError("a damaged summary")
        match opcode:
            case Opcode.CHUNK_INDEX:
                *_, position, _, offsets = CHUNK_INDEX.unpack_from(content)
                (length_behind,) = INDEX_LENGTH.unpack_from(content, CHUNK_INDEX.size + offsets)
                found.opcodes[position] = Opcode.CHUNK
                found.indices[position] = length_behind
            case Opcode.METADATA_INDEX:
                found.opcodes[WHERE.unpack_from(content)[0]] = Opcode.METADATA
            case Opcode.ATTACHMENT_INDEX:
                found.opcodes[WHERE.unpack_from(content)[0]] = Opcode.ATTACHMENT
            case Opcode.STATISTICS:
                (found.messages,) = STATISTICS.unpack_from(content)
            case Opcode.SCHEMA:
                found.described.append(Schema.read(ReadDataStream(BytesIO(content))))
            case Opcode.CHANNEL:
                found.described.append(Channel.read(ReadDataStream(BytesIO(content))))
            case _:
                pass
        at += length
    if any(not len(MAGIC) <= position < start for position in found.opcodes):
        raise ValueError("a damaged summary")
    return found
