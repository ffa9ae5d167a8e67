"""The records of an MCAP file, in order, up to its end or to where it is truncated or damaged.

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


def records(path: Path, *, open_chunks: bool = True) -> Iterator[StoredMessage | Described]:
    """Everything in a file; without what is in its chunks if these are not to be opened."""
    with path.open("rb") as stream, suppress(*DAMAGE):
        size = path.stat().st_size
        if stream.read(len(MAGIC)) != MAGIC:
            return
        while head := stream.read(RECORD_HEAD.size):
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
