"""The records of an MCAP file, in order, and where it is cut off or damaged. https://mcap.dev/spec

Behind a record that cannot be read the next one follows by its length, or, where that is damaged,
the next chunk of the summary. The mcap library reads all records but messages, for which it makes
ten calls each where this makes one.
"""

import os
import struct
import zlib
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from math import inf
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import zstandard
from lz4.frame import LZ4FrameDecompressor  # pyright: ignore[reportMissingTypeStubs]
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema, Statistics

from services.recorder.foxglove.channel import is_view
from services.recorder.io.mcap_file import MAGIC

DIVE, HASH, LOSSES, MERGED = "dive", "hash", "losses", "merged"  # metadata of Lindy's files
MENDED_BY = "lindy log recover makes a whole file of the rest"
# What reading a truncated or damaged file raises; a damaged length can exhaust the memory.
DAMAGE = (
    McapError, struct.error, zstandard.ZstdError, ValueError, RuntimeError, OverflowError,
    MemoryError,
)  # fmt: skip
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
MESSAGE = int(Opcode.MESSAGE)
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log and publish time
CHUNK_TIMES = struct.Struct("<QQ")  # first and last log time, how a chunk and its index begin
LARGEST_CHUNK = 100_000_000  # [bytes] uncompressed; what others write has a few million
FOOTER = struct.Struct("<BQQQI")  # opcode, length, starts of the summary and its offsets, checksum
CHECKSUM = struct.Struct("<I")
DATA_END = RECORD_HEAD.size + CHECKSUM.size  # [bytes]; it is directly before the summary
WHERE = struct.Struct("<Q")  # where a chunk begins, in its entry of a summary
At = Callable[[int], None]
Span = tuple[float, float]  # [ns] UTC from, inclusive, and to, exclusive
ALWAYS = (-inf, inf)


def nowhere(_: int) -> None:
    """Nobody wants to know how far a file was read."""


class Raw(NamedTuple):
    """A message as stored in the file."""

    key: str  # empty: the file does not describe its channel
    data: bytes  # JSON
    log_ns: int  # [ns] UTC of arrival
    publish_ns: int  # [ns] UTC of the message's own stamp; of arrival if of an unknown clock
    sequence: int = 0  # the publisher's count, modulo 2³²
    channel_id: int = 0


Described = Attachment | Channel | Metadata | Schema
Wants = Callable[[str], bool]  # topics of which the messages are wanted
READ: dict[int, Callable[[ReadDataStream], Described]] = {
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.METADATA: Metadata.read,
    Opcode.SCHEMA: Schema.read,
}


def always(_: str) -> bool:
    return True


@dataclass
class FileIndex:
    """What the end of a file says of the rest. Empty where it has no summary, or a damaged one."""

    ended: bool = False  # the file has an end, with or without a summary
    damaged_at: int | None = None  # [bytes] where the summary begins that cannot be read
    messages: int | None = None  # that the file says it has, without views
    chunks: list[int] = field(default_factory=list[int])  # [bytes] where they begin …
    data_end: int = 0  # [bytes] … and where the summary's part of the file does
    described: list[Schema | Channel] = field(default_factory=list[Schema | Channel])

    def following(self, position: int) -> int | None:
        """[bytes] Where the next known record begins."""
        place = bisect_right(self.chunks, position)
        following = [*self.chunks[place : place + 1], self.data_end]
        return next((at for at in following if at > position), None)


class Damage:
    """What was wrong with a file that was read in spite of it."""

    def __init__(self) -> None:
        self.places: list[int] = []  # [bytes] where a record begins that cannot be read
        self.cut_off = False  # the file ends in the middle of a record, or before its end
        self.messages = 0  # that were read, or passed over in a sound chunk, without views
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


def records(path: Path, damage: Damage | None = None) -> Iterator[Raw | Described]:
    """Everything in a file, as `records_in` gives it."""
    with path.open("rb") as stream:
        yield from records_in(stream, damage=damage)


def records_in(
    stream: BinaryIO,
    *,
    open_chunks: bool = True,
    at: At = nowhere,
    damage: Damage | None = None,
    wants: Wants = always,
    within: Span = ALWAYS,
) -> Iterator[Raw | Described]:
    """Everything in an open file, also what follows a damaged record. Behind the first one that is
    damaged or passed over come the schemas and channels that the summary describes, in case that it
    had them.

    Args:
        open_chunks: also what is in its chunks.
        at: told how far it has been read [bytes].
        damage: told what cannot be read; complete at the end.
        wants: messages of other topics are passed over.
        within: chunks without a message in this time are not opened, where there is a summary;
            messages before and after it may be given.
    """
    damage = Damage() if damage is None else damage
    began = os.fstat(stream.fileno())  # also of a file that is moved away meanwhile
    reader = _RecordReader(stream, began.st_size, damage, wants, within, open_chunks)
    described = False
    position: int | None = len(MAGIC)
    while position is not None:
        at(position)
        try:
            opcode, found, after = reader.read(position)
        except DAMAGE:
            opcode, found, after = 0, [], reader.beyond(position)
            if after is not None:
                damage.places.append(position)
        if opcode == Opcode.DATA_END:
            return
        if not described and (damage.passed_over or damage.places):
            described = True
            yield from reader.known()
        yield from found
        if opcode == 0 or after is None:
            now = os.fstat(stream.fileno())
            damage.written |= (now.st_size, now.st_mtime_ns) != (
                began.st_size, began.st_mtime_ns,
            )  # fmt: skip
        position = after
    damage.cut_off = True


@dataclass
class _RecordReader:
    """Reads one record after the other, and finds the next behind one that is damaged."""

    stream: BinaryIO
    size: int  # [bytes]
    damage: Damage
    wants: Wants
    within: Span
    open_chunks: bool
    keys: dict[int, str] = field(default_factory=dict[int, str])  # of the channels …
    passed_over: set[int] = field(default_factory=set[int])  # … those that are not wanted …
    views: set[int] = field(default_factory=set[int])  # … and those that are drawn for Foxglove

    def __post_init__(self) -> None:
        self.index = self.damage.index = index_of(self.stream, self.size)
        self.chunked = bool(self.index.chunks)  # then there is no message outside a chunk

    def read(self, position: int) -> tuple[int, list[Raw | Described], int | None]:
        """(opcode, what is in it, where it ends). It ends nowhere where it is a chunk whose writer
        was killed between the two writes of a flush.

        Raises:
            DAMAGE: it is damaged or cut off.
        """
        self.stream.seek(position)
        head = self.stream.read(RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head)
        after = position + RECORD_HEAD.size + length
        if opcode == 0 or after > (self.index.following(position) or self.size):
            raise ValueError("another record is here, or it ends behind where the next one begins")
        if opcode == Opcode.CHUNK:
            self.chunked = True
            if not self.open_chunks:
                return opcode, [], after
            found, whole = self._chunk(self.stream.read(length))
            return opcode, found, after if whole or self.index.chunks else None
        if opcode == MESSAGE and self.chunked:
            raise ValueError("a message outside a chunk")
        if opcode != MESSAGE and opcode not in READ:
            return opcode, [], after
        content = self.stream.read(length)
        if opcode == Opcode.ATTACHMENT:
            _check(content[: -CHECKSUM.size], *CHECKSUM.unpack(content[-CHECKSUM.size :]))
        found = self._split(head + content)
        self.damage.metadata.update(each.name for each in found if isinstance(each, Metadata))
        return opcode, found, after

    def known(self) -> list[Schema | Channel]:
        """Everything that the summary describes."""
        for record in self.index.described:
            self._see(record)
        return self.index.described

    def beyond(self, position: int) -> int | None:
        """[bytes] Where the record behind a damaged one begins; None: there is no more."""
        self.stream.seek(position)
        head = self.stream.read(RECORD_HEAD.size)
        known = self.index.following(position)
        if len(head) == RECORD_HEAD.size and head[0]:  # no record begins with zero
            after = position + RECORD_HEAD.size + RECORD_HEAD.unpack(head)[1]
            if after <= (known or self.size):
                return after
        return known

    def _chunk(self, content: bytes) -> tuple[list[Raw | Described], bool]:
        """What is in it, and whether it is whole."""
        first, last = CHUNK_TIMES.unpack_from(content)
        begin, end = self.within
        if self.index.chunks and (last < begin or first >= end):
            self.damage.passed_over = True
            return [], True
        data, whole = _uncompressed(content)
        return self._split(data), whole

    def _see(self, record: Described) -> None:
        """Before the first message of its channel."""
        if isinstance(record, Channel):
            self.keys[record.id] = record.topic
            for known, is_one in (
                (self.passed_over, not self.wants(record.topic)),
                (self.views, is_view(record.topic)),
            ):
                known.discard(record.id)
                if is_one:
                    known.add(record.id)

    def _split(self, data: bytes) -> list[Raw | Described]:
        """
        Raises:
            DAMAGE: it makes no sense.
        """
        found: list[Raw | Described] = []
        at, end, messages = 0, len(data), 0
        keys, passed_over, views = self.keys, self.passed_over, self.views
        unpack = MESSAGE_HEAD.unpack_from
        while at < end:
            if data[at] != MESSAGE:
                opcode, length = RECORD_HEAD.unpack_from(data, at)
                at += RECORD_HEAD.size + length
                if (read := READ.get(opcode)) is not None:
                    record = read(ReadDataStream(BytesIO(data[at - length : at])))
                    self._see(record)
                    found.append(record)
                continue
            _, length, channel, sequence, log_ns, publish_ns = unpack(data, at)
            begin = at + MESSAGE_HEAD.size
            at += RECORD_HEAD.size + length
            messages += channel not in views
            if channel not in passed_over:
                key, content = keys.get(channel, ""), data[begin:at]
                found.append(Raw(key, content, log_ns, publish_ns, sequence, channel))
        self.damage.messages += messages
        return found


def _check(content: bytes, checksum: int) -> None:
    """
    Raises:
        ValueError: it is damaged.
    """
    if checksum not in (0, zlib.crc32(content)):
        raise ValueError("a wrong checksum")


def _uncompressed(content: bytes) -> tuple[bytes, bool]:
    """The records in a chunk, checked by its CRC; and whether the chunk is whole.

    The last chunk is not when its writer was killed between the two writes of a flush: its head is
    then still that of the flush before, and describes the beginning of the data.
    """
    chunk = Chunk.read(ReadDataStream(BytesIO(content)))
    size, whole = chunk.uncompressed_size, True
    data: bytes
    if size > LARGEST_CHUNK:
        raise ValueError(f"{size / 1e6:.0f} MB in one chunk")
    match chunk.compression:
        case "zstd":
            stream = zstandard.ZstdDecompressor().decompressobj()
            data = stream.decompress(chunk.data)[:size]
            whole = stream.eof
        case "lz4":
            frame: Any = LZ4FrameDecompressor()
            data = frame.decompress(chunk.data)
        case "":
            data = chunk.data
        case other:
            raise ValueError(f"compressed by {other!r}")
    _check(data, chunk.uncompressed_crc)
    return data, whole


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
        with suppress(*DAMAGE):
            _check(summary + tail[: FOOTER.size - CHECKSUM.size], checksum)
            return _summary(summary, start)
    return FileIndex(ended=True, damaged_at=at)


def _summary(summary: bytes, start: int) -> FileIndex:
    """
    Raises:
        DAMAGE: it makes no sense.
    """
    found = FileIndex(ended=True, data_end=start - DATA_END)
    at, counts, views = 0, dict[int, int](), set[int]()
    while at < len(summary):
        opcode, length = RECORD_HEAD.unpack_from(summary, at)
        at += RECORD_HEAD.size
        stream = ReadDataStream(BytesIO(summary[at : at + length]))
        match opcode:
            case Opcode.CHUNK_INDEX:
                found.chunks += WHERE.unpack_from(summary, at + CHUNK_TIMES.size)
            case Opcode.STATISTICS:
                statistics = Statistics.read(stream)
                counts, found.messages = statistics.channel_message_counts, statistics.message_count
            case Opcode.SCHEMA:
                found.described.append(Schema.read(stream))
            case Opcode.CHANNEL:
                found.described.append(channel := Channel.read(stream))
                if is_view(channel.topic):
                    views.add(channel.id)
            case _:
                pass
        at += length
    found.chunks.sort()
    if found.messages is not None:
        found.messages -= sum(counts.get(channel, 0) for channel in views)
    if at != len(summary) or not all(len(MAGIC) <= each < start for each in found.chunks):
        raise ValueError("a damaged summary")
    return found
