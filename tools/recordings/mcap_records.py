"""The records of an MCAP file, in order, and where it is truncated or damaged.

The index is needed only to go on behind a damaged record; where there is none, the next chunk is
looked for. The mcap library's own reader makes ten calls for each message and each entry of an
index; this one makes one.
"""

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from math import inf
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import zstandard
from lz4.frame import LZ4FrameDecompressor  # pyright: ignore[reportMissingTypeStubs]
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema

from services.recorder.io.open_chunk import CHUNK_HEAD, MAGIC
from tools.recordings.mcap_index import DAMAGE, RECORD_HEAD, FileIndex, index_of

DIVE, HASH, LOSSES, MERGED = "dive", "hash", "losses", "merged"  # metadata of Lindy's files
MENDED_BY = "lindy log recover makes a whole file of the rest"
MESSAGE = int(Opcode.MESSAGE)
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log and publish time
CHUNK_TIMES = struct.Struct("<QQ")  # first and last log time, how a chunk begins
ZSTD = b"\x04\x00\x00\x00zstd"  # in the head of a chunk …
LARGEST_CHUNK = 100_000_000  # [bytes] uncompressed; what others write has a few million
ZSTD_AT = 37  # [bytes] … behind its beginning
CHECKSUM = struct.Struct("<I")
At = Callable[[int], None]
Noticed = Callable[[int, int, int, bytes], None]  # sequence, log [ns], publish [ns], data
Span = tuple[float, float]  # [ns] UTC from, inclusive, and to, exclusive
ALWAYS = (-inf, inf)


def nowhere(_: int) -> None:
    """Nobody wants to know how far a file was read."""


class StoredMessage(NamedTuple):
    channel_id: int
    sequence: int
    log_ns: int  # [ns] UTC
    publish_ns: int  # [ns] UTC
    data: bytes


Described = Attachment | Channel | Metadata | Schema


class Reading(NamedTuple):
    """What a reader does with the messages of a channel."""

    wanted: bool = True  # they are given to it; else they are passed over
    noticed: Noticed | None = None  # told of each in any case, before any of its chunk is given


Readings = Callable[[Channel, Schema | None], Reading]  # None: its schema is not in the file


def everything(_: Channel, _of: Schema | None) -> Reading:
    return Reading()


def no_message(_: Channel, _of: Schema | None) -> Reading:
    return Reading(wanted=False)


READ: dict[int, Callable[[ReadDataStream], Described]] = {
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.METADATA: Metadata.read,
    Opcode.SCHEMA: Schema.read,
}


class Damage:
    """What was wrong with a file that was read in spite of it."""

    def __init__(self) -> None:
        self.places: list[int] = []  # [bytes] where a record begins that cannot be read
        self.cut_off = False  # the file ends in the middle of a record, or before its end
        self.messages = 0  # that were read, or passed over in a sound chunk
        self.passed_over = False  # chunks were: what is in them is not known
        self.written = False  # somebody wrote it meanwhile
        self.metadata: set[str] = set()  # names of those that were read
        self.index = FileIndex()

    def in_words(self, name: str) -> list[str]:
        """What a reader of the file should know, one sentence each; nothing where it is whole.

        Args:
            name: of the file.
        """
        if self.written:
            return [f"{name} is still being written: look again when the dive has ended"]
        named = self.index.messages
        lost = None if named is None or self.passed_over else named - self.messages
        places = [*self.places, *filter(None, [self.index.damaged_at])]
        found: list[str] = []
        if places:
            more = f" and at {len(places) - 1} more places" if len(places) > 1 else ""
            how_many = "" if lost is None else f": {lost} of its {named} messages cannot be read"
            found.append(f"{name} is damaged at byte {places[0]}{more}{how_many}; {MENDED_BY}")
        elif lost:
            found.append(
                f"{name} is damaged: {self.messages} messages can be read where it says that it "
                f"has {named}; {MENDED_BY}"
            )
        if self.cut_off or not self.index.ended or self._recorder_failed:
            found.append(f"{name} was not finished: what was recorded last may be missing")
        return found

    @property
    def _recorder_failed(self) -> bool:
        """Lindy's recorder ends a file with what it lost and a summary. On a full disk it ends it
        without; and where it was killed, the file gets a summary later, when it is merged."""
        if DIVE not in self.metadata or self.places or self.index.damaged_at is not None:
            return False
        no_summary = self.index.messages is None
        return no_summary or (MERGED in self.metadata and LOSSES not in self.metadata)


def salvaged(path: Path, damage: Damage, at: At = nowhere) -> Iterator[StoredMessage | Described]:
    """As `records`, and the beginning of a chunk that is cut off."""
    return records(path, at=at, damage=damage, open_beginnings=True)


def records(
    path: Path,
    *,
    open_chunks: bool = True,
    open_beginnings: bool = False,
    at: At = nowhere,
    damage: Damage | None = None,
    readings: Readings = everything,
    within: Span = ALWAYS,
) -> Iterator[StoredMessage | Described]:
    """Everything in a file, also what follows a damaged record. Behind the first one that is
    damaged or passed over come the schemas and channels that the summary describes, in case that it
    had them.

    Args:
        open_chunks: also what is in its chunks.
        open_beginnings: also what is in a chunk that is cut off.
        at: told how far it has been read [bytes].
        damage: told what cannot be read; complete at the end.
        readings: of which channels the messages are wanted.
        within: chunks without a message in this time are not opened, where there is a summary;
            messages before and after it may be given.
    """
    damage = Damage() if damage is None else damage
    with path.open("rb") as stream:
        began = os.fstat(stream.fileno())  # also of a file that is moved away meanwhile
        size = began.st_size
        reader = _RecordReader(stream, size, damage, readings, within, open_chunks=open_chunks)
        described = False
        position = len(MAGIC)
        while True:
            at(position)
            try:
                opcode, found, after = reader.read(position)
            except DAMAGE:
                damage.written |= _is_written(stream, began)
                beyond = reader.beyond(position)
                if beyond is None:
                    damage.cut_off = True
                    if open_beginnings:
                        yield from reader.beginning(position)
                    return
                if not described:
                    described = True
                    yield from reader.known()
                damage.places.append(position)
                position = beyond
                continue
            if opcode == Opcode.DATA_END:
                return
            if damage.passed_over and not described:
                described = True
                yield from reader.known()
            yield from found
            if after is None:
                damage.written |= _is_written(stream, began)
                damage.cut_off = True
                return
            position = after


def _is_written(stream: BinaryIO, began: os.stat_result) -> bool:
    """Has somebody written the file since it was opened?"""
    now = os.fstat(stream.fileno())
    return (now.st_size, now.st_mtime_ns) != (began.st_size, began.st_mtime_ns)


class _RecordReader:
    """Reads one record after the other, and finds the next behind one that is damaged."""

    def __init__(
        self,
        stream: BinaryIO,
        size: int,
        damage: Damage,
        readings: Readings,
        within: Span,
        *,
        open_chunks: bool,
    ) -> None:
        self.index = damage.index = index_of(stream, size)
        self._stream = stream
        self._size = size  # [bytes]
        self._damage = damage
        self._splitting = _Splitting(readings)
        self._within = within
        self._open_chunks = open_chunks
        self._chunked = self.index.has_chunks  # then there is no message outside a chunk

    def read(self, position: int) -> tuple[int, list[StoredMessage | Described], int | None]:
        """(opcode, what is in it, where it ends). It ends nowhere where it is a chunk whose writer
        was killed between the two writes of a flush.

        Raises:
            DAMAGE: it is damaged or cut off.
        """
        self._stream.seek(position)
        head = self._stream.read(RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head)
        after = position + RECORD_HEAD.size + length
        if self.index.opcodes.get(position, opcode) != opcode or opcode == 0:
            raise ValueError("another record is here")
        if after > (self.index.following(position) or self._size):
            raise ValueError("it ends behind the beginning of the next one")
        if opcode == Opcode.CHUNK:
            self._chunked = True
            return self._chunk(position, length, after)
        if opcode == Opcode.MESSAGE and self._chunked:
            raise ValueError("a message outside a chunk")
        if opcode != Opcode.MESSAGE and opcode not in READ:
            return opcode, [], after
        content = self._stream.read(length)
        if opcode == Opcode.ATTACHMENT:
            _check_attachment(content)
        found = self._splitting.split(head + content)
        self._damage.messages += opcode == Opcode.MESSAGE
        self._damage.metadata.update(each.name for each in found if isinstance(each, Metadata))
        return opcode, found, after

    def _chunk(
        self, position: int, length: int, after: int
    ) -> tuple[int, list[StoredMessage | Described], int | None]:
        behind = after + self.index.indices.get(position, 0)  # of its messages, which nobody needs
        if not self._open_chunks:
            return Opcode.CHUNK, [], behind
        content = self._stream.read(length)
        first, last = CHUNK_TIMES.unpack_from(content)
        begin, end = self._within
        if self.index.has_chunks and (last < begin or first >= end):
            self._damage.passed_over = True
            return Opcode.CHUNK, [], behind
        data, whole = _uncompressed(content)
        before = self._splitting.messages
        found = self._splitting.split(data)
        self._damage.messages += self._splitting.messages - before
        return Opcode.CHUNK, found, behind if whole or self.index.has_chunks else None

    def known(self) -> list[Schema | Channel]:
        """Everything that the summary describes."""
        for record in self.index.described:
            self._splitting.see(record)
        return self.index.described

    def beyond(self, position: int) -> int | None:
        """[bytes] Where the record behind a damaged one begins; None: there is no more."""
        known = self.index.following(position) if self.index.starts else self._next_chunk(position)
        self._stream.seek(position)
        head = self._stream.read(RECORD_HEAD.size)
        if len(head) == RECORD_HEAD.size:
            after = position + RECORD_HEAD.size + RECORD_HEAD.unpack(head)[1]
            if after <= (known or self._size):
                return after
        return known

    def _next_chunk(self, position: int) -> int | None:
        """[bytes] Where the next chunk begins as Lindy writes them, known by its head."""
        if position + CHUNK_HEAD.size > self._size:
            return None
        with mmap(self._stream.fileno(), 0, access=ACCESS_READ) as whole:
            at = whole.find(ZSTD, position + 1 + ZSTD_AT)
            while at >= 0:
                head = whole[at - ZSTD_AT : at - ZSTD_AT + CHUNK_HEAD.size]
                if len(head) == CHUNK_HEAD.size:
                    opcode, length, *_, size = CHUNK_HEAD.unpack(head)
                    if (
                        opcode == Opcode.CHUNK
                        and length == CHUNK_HEAD.size + size - RECORD_HEAD.size
                    ):
                        return at - ZSTD_AT
                at = whole.find(ZSTD, at + 1)
        return None

    def beginning(self, position: int) -> Iterator[StoredMessage | Described]:
        """What is whole in a chunk of zstd that is cut off."""
        self._stream.seek(position)
        head, data = self._stream.read(CHUNK_HEAD.size), self._stream.read(LARGEST_CHUNK)
        if head[:1] != bytes([Opcode.CHUNK]) or head[ZSTD_AT : ZSTD_AT + len(ZSTD)] != ZSTD:
            return
        with suppress(*DAMAGE):
            data = zstandard.ZstdDecompressor().decompressobj().decompress(data)
            at = 0
            while at + RECORD_HEAD.size <= len(data):
                after = at + RECORD_HEAD.size + RECORD_HEAD.unpack_from(data, at)[1]
                if after > len(data):
                    return
                yield from self._splitting.split(data[at:after])
                at = after


def _check_attachment(content: bytes) -> None:
    """
    Raises:
        ValueError: its checksum is wrong.
    """
    (checksum,) = CHECKSUM.unpack(content[-CHECKSUM.size :])
    if checksum not in (0, zlib.crc32(content[: -CHECKSUM.size])):
        raise ValueError("a damaged attachment")


def _uncompressed(content: bytes) -> tuple[bytes, bool]:
    """The records in a chunk, checked by its CRC; and whether the chunk is whole.

    The last chunk is not when its writer was killed between the two writes of a flush: its head is
    then still that of the flush before, and describes the beginning of the data.
    """
    chunk = Chunk.read(ReadDataStream(BytesIO(content)))
    if chunk.uncompressed_size > LARGEST_CHUNK:
        size = f"{chunk.uncompressed_size / 1e6:.0f} MB in one chunk"
        raise ValueError(f"{size}, allowed is {LARGEST_CHUNK // 1_000_000}")
    whole = True
    match chunk.compression:
        case "zstd":
            data, whole = _opened(chunk.data, chunk.uncompressed_size)
        case "lz4":
            data = _opened_lz4(chunk.data, chunk.uncompressed_size)
        case "":
            data = chunk.data
        case other:
            raise ValueError(f"compressed by {other!r}")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("a damaged chunk")
    return data, whole


def _opened(data: bytes, most: int) -> tuple[bytes, bool]:
    """Of zstd: at most so many bytes, and whether that was all."""
    with suppress(zstandard.ZstdError):
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=most), True
    frame = zstandard.ZstdDecompressor().decompressobj()
    return frame.decompress(data)[:most], frame.eof


def _opened_lz4(data: bytes, most: int) -> bytes:
    """As others write it: at most so many bytes.

    Raises:
        ValueError: it is damaged.
    """
    frame: Any = LZ4FrameDecompressor()
    try:
        return frame.decompress(data, max_length=most)
    except RuntimeError as error:
        raise ValueError(error) from None


class _Splitting:
    """Takes records apart, without the messages that are not wanted: of those no more is read than
    how long they are. A recording of a day has 90 million."""

    def __init__(self, readings: Readings) -> None:
        self.messages = 0  # so far
        self._readings = readings
        self._passed_over: set[int] = set()  # channels
        self._noticed: dict[int, Noticed] = {}  # by channel
        self._schemas: dict[int, Schema] = {}

    def see(self, record: Described) -> None:
        """Before the first message of its channel."""
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            wanted, noticed = self._readings(record, self._schemas.get(record.schema_id))
            self._passed_over.discard(record.id)
            self._noticed.pop(record.id, None)
            if not wanted:
                self._passed_over.add(record.id)
            if noticed is not None:
                self._noticed[record.id] = noticed

    def split(self, data: bytes) -> list[StoredMessage | Described]:
        """
        Raises:
            DAMAGE: it makes no sense.
        """
        found: list[StoredMessage | Described] = []
        at, end, messages = 0, len(data), 0
        passed_over, tell, unpack = self._passed_over, self._noticed, MESSAGE_HEAD.unpack_from
        while at < end:
            if data[at] != MESSAGE:
                at = self._other(data, at, found)
                continue
            _, length, channel, sequence, log_ns, publish_ns = unpack(data, at)
            begin = at + MESSAGE_HEAD.size
            at += RECORD_HEAD.size + length
            messages += 1
            if channel in tell:
                tell[channel](sequence, log_ns, publish_ns, data[begin:at])
            if channel not in passed_over:
                found.append(StoredMessage(channel, sequence, log_ns, publish_ns, data[begin:at]))
        self.messages += messages
        return found

    def _other(self, data: bytes, at: int, found: list[StoredMessage | Described]) -> int:
        """A record that is no message. Returns where it ends."""
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        begin = at + RECORD_HEAD.size
        if (read := READ.get(opcode)) is not None:
            record = read(ReadDataStream(BytesIO(data[begin : begin + length])))
            self.see(record)
            found.append(record)
        return begin + length
