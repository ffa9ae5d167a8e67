"""The records of an MCAP file, in order, up to its end or to where it is truncated or damaged; or,
to mend it, everything that can be read in spite of that.

Only what is in the data section: no index is needed or read. The mcap library's own reader makes
ten calls for each message and each entry of an index; this one makes one.
"""

import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream

from services.recorder.io.open_chunk import MAGIC

# What reading a truncated or damaged file raises; a damaged length can exhaust the memory.
DAMAGE = (McapError, struct.error, zstandard.ZstdError, ValueError, OverflowError, MemoryError)
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time


CHUNK_NUMBERS = struct.Struct("<QQQI")  # first and last log time, size, checksum
LETTERS, LENGTH = struct.Struct("<I"), struct.Struct("<Q")
At = Callable[[int], None]


def nowhere(_: int) -> None:
    """Nobody wants to know how far a file was read."""


class StoredMessage(NamedTuple):
    channel_id: int
    sequence: int
    log_ns: int  # [ns] UTC
    publish_ns: int  # [ns] UTC
    data: bytes


Described = Attachment | Channel | Metadata | Schema
READ: dict[int, Callable[[ReadDataStream], Described]] = {
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.METADATA: Metadata.read,
    Opcode.SCHEMA: Schema.read,
}


class Damage:
    """What was wrong with a file that was read in spite of it."""

    def __init__(self) -> None:
        self.records = 0  # skipped: chunks, or others, that could not be read
        self.cut_off = False  # the file ends in the middle of a record, or before its end


def salvaged(path: Path, damage: Damage, at: At = nowhere) -> Iterator[StoredMessage | Described]:
    """Everything in a file that can still be read: what follows a damaged record, and the beginning
    of a chunk that is cut off."""
    with path.open("rb") as stream, suppress(*DAMAGE):
        size = path.stat().st_size
        damage.cut_off = True
        if stream.read(len(MAGIC)) != MAGIC:
            return
        while len(head := stream.read(RECORD_HEAD.size)) == RECORD_HEAD.size:
            at(stream.tell())
            opcode, length = RECORD_HEAD.unpack(head)
            if opcode == Opcode.DATA_END:
                damage.cut_off = False
                return
            if stream.tell() + length > size:
                if opcode == Opcode.CHUNK:
                    yield from _split_whole(_beginning(stream.read()))
                return
            content = stream.read(length)
            try:
                if opcode == Opcode.CHUNK:
                    data, whole = _uncompressed(BytesIO(content), length)
                    found = [*_split(data)]
                    damage.cut_off = not whole
                else:
                    found = [*_split(head + content)]
            except DAMAGE:
                damage.records += 1
                continue
            yield from found


def records(
    path: Path, *, open_chunks: bool = True, at: At = nowhere
) -> Iterator[StoredMessage | Described]:
    """Everything in a file; without what is in its chunks if these are not to be opened.

    Args:
        at: told how far it has been read [bytes].
    """
    with path.open("rb") as stream, suppress(*DAMAGE):
        size = path.stat().st_size
        if stream.read(len(MAGIC)) != MAGIC:
            return
        while head := stream.read(RECORD_HEAD.size):
            at(stream.tell())
            opcode, length = RECORD_HEAD.unpack(head)
            if opcode == Opcode.DATA_END or stream.tell() + length > size:
                return
            if opcode == Opcode.CHUNK and open_chunks:
                data, whole = _uncompressed(stream, length)
                yield from _split(data)
                if not whole:
                    return
            elif opcode == Opcode.MESSAGE or opcode in READ:
                yield from _split(head + stream.read(length))
            else:
                stream.seek(length, 1)


def _uncompressed(stream: BinaryIO, length: int) -> tuple[bytes, bool]:
    """The records in a chunk, checked by its CRC; and whether the chunk is whole.

    The last chunk is not when its writer was killed between the two writes of a flush: its head is
    then still that of the flush before, and describes the beginning of the data.
    """
    chunk = Chunk.read(ReadDataStream(BytesIO(stream.read(length))))
    if chunk.compression != "zstd":
        opened, size = get_chunk_data_stream(chunk, validate_crc=True)
        return opened.read(size), True
    frame = zstandard.ZstdDecompressor().decompressobj()
    data = frame.decompress(chunk.data)[: chunk.uncompressed_size]
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("a damaged chunk")
    return data, frame.eof


def _beginning(chunk: bytes) -> bytes:
    """What the beginning of a chunk holds, uncompressed; nothing where it cannot be read, or is not
    compressed as Lindy does it."""
    with suppress(*DAMAGE):
        at = CHUNK_NUMBERS.size
        (letters,) = LETTERS.unpack_from(chunk, at)
        at += LETTERS.size
        compression = chunk[at : at + letters]
        data = chunk[at + letters + LENGTH.size :]
        if compression == b"zstd":
            return zstandard.ZstdDecompressor().decompressobj().decompress(data)
        return data if not compression else b""
    return b""


def _split_whole(data: bytes) -> Iterator[StoredMessage | Described]:
    """The records in it, up to one that is cut off or makes no sense."""
    at, end = 0, len(data)
    with suppress(*DAMAGE):
        while at + RECORD_HEAD.size <= end:
            _, length = RECORD_HEAD.unpack_from(data, at)
            after = at + RECORD_HEAD.size + length
            if after > end:
                return
            yield from _split(data[at:after])
            at = after


def _split(data: bytes) -> Iterator[StoredMessage | Described]:
    at, end = 0, len(data)
    while at < end:
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        at += RECORD_HEAD.size
        content = at + MESSAGE_HEAD.size
        if opcode == Opcode.MESSAGE:
            channel, sequence, log_ns, publish_ns = MESSAGE_HEAD.unpack_from(data, at)
            yield StoredMessage(channel, sequence, log_ns, publish_ns, data[content : at + length])
        elif (read := READ.get(opcode)) is not None:
            yield read(ReadDataStream(BytesIO(data[at : at + length])))
        at += length
