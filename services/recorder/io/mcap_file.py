"""Writes one MCAP file: https://mcap.dev/spec. Any method raises OSError when the disk fails; the
file must then be abandoned, and what was flushed can be read by any reader.

The mcap library's own writer closes a chunk at each flush, which made files larger and kept an
index in memory that grew with every flush. So only its records are used.

Large chunks are small and cheap, but a killed recorder may lose only a quarter of a second. So the
zstd frame of a chunk is written piece by piece: a flush appends what is new, ends the frame, and
writes the sizes into the head of the chunk. The file then consists of whole records, and any reader
can read it. The next flush overwrites the end of the frame and continues it.
"""

import contextlib
import io
import struct
import zlib
from itertools import groupby
from pathlib import Path
from typing import IO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import MessageEncoding, SchemaEncoding

LEVEL = 1  # of zstd: these messages become smaller than at level 3, in less time
COMPRESSION = b"zstd"
# Opcode, length, first and last log time, uncompressed size and CRC, compression, compressed size.
CHUNK_HEAD = struct.Struct("<BQQQQII4sQ")
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # … channel, sequence, log time, publish time
MAGIC = b"\x89MCAP0\r\n"  # first and last bytes of a whole file
# The shortest valid end of a file: DataEnd and Footer without an index.
ENDING = struct.pack("<BQI", 0x0F, 4, 0) + struct.pack("<BQQQI", 0x02, 20, 0, 0, 0) + MAGIC
# A record that readers pass over, behind all that is flushed: on a full disk it is replaced by the
# ending, for which there may be no room otherwise.
ROOM = struct.pack("<BQ", 0x80, len(ENDING) - 9) + bytes(len(ENDING) - 9)
END_OF_FRAME = b"\x01\x00\x00"  # RFC 8878, 3.1.1.2: a last block, raw, of no bytes


def encoded(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def write_at(file: IO[bytes], position: int, data: bytes | bytearray) -> None:
    """Write all of it, or raise OSError."""
    file.seek(position)
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


class OpenChunk:
    """Collects records; a flush brings them into the file. Any method may raise OSError."""

    def __init__(self, file: io.FileIO, position: int) -> None:
        """
        Args:
            position: [bytes] end of the file so far, where the chunk begins.
        """
        self.size = 0  # [bytes] of all records, uncompressed
        self.end = position  # [bytes] where the chunk ends in the file: as it begins, when empty
        self._file = file
        self._position = position
        self._fresh = bytearray()  # records not in the file yet
        self._first_ns = 2**64 - 1  # [ns] of the log times
        self._last_ns = 0
        self._index: dict[int, list[int]] = {}  # by channel: log time, offset, log time, …
        self._head = b""  # as it is in the file
        self._crc = 0  # of the records in the file
        self._frame = zstandard.ZstdCompressor(level=LEVEL, write_content_size=False).compressobj()

    def add(self, record: bytes) -> None:
        """Add a schema or a channel."""
        self._fresh += record
        self.size += len(record)

    def add_message(
        self, channel: int, data: bytes, log_ns: int, publish_ns: int, sequence: int
    ) -> None:
        if log_ns < self._first_ns:
            self._first_ns = log_ns
        if log_ns > self._last_ns:
            self._last_ns = log_ns
        index = self._index.get(channel)
        if index is None:
            index = self._index[channel] = []
        index += (log_ns, self.size)
        length = MESSAGE_HEAD.size - RECORD_HEAD.size + len(data)
        self._fresh += MESSAGE_HEAD.pack(
            Opcode.MESSAGE, length, channel, sequence, log_ns, publish_ns
        )
        self._fresh += data
        self.size += RECORD_HEAD.size + length

    def flush(self) -> None:
        """Bring what is new into the file."""
        if not self._fresh:
            return
        crc = zlib.crc32(self._fresh, self._crc)
        piece = self._frame.compress(self._fresh)
        piece += self._frame.flush(zstandard.COMPRESSOBJ_FLUSH_BLOCK) + END_OF_FRAME
        begun = self.end > self._position
        at = self.end - len(END_OF_FRAME) if begun else self._position + CHUNK_HEAD.size
        end = at + len(piece)
        head = self._encode_head(end, crc)
        if begun:
            # A reader can tell when only the first of these two was done: the head still describes
            # the beginning of the frame.
            write_at(self._file, at, piece + ROOM)
            write_at(self._file, self._position, head)
        else:
            write_at(self._file, self._position, head + piece + ROOM)
        self._head, self._crc, self.end = head, crc, end
        self._fresh.clear()

    def finish(self) -> ChunkIndex:
        """Write the index of the messages behind the chunk, once everything is flushed."""
        offsets: dict[int, int] = {}
        indices = bytearray()
        for channel, entries in self._index.items():
            offsets[channel] = self.end + len(indices)
            indices += _message_index(channel, entries)
        write_at(self._file, self.end, indices + ROOM)
        return ChunkIndex(
            chunk_length=self.end - self._position,
            chunk_start_offset=self._position,
            compression=COMPRESSION.decode(),
            compressed_size=self.end - self._position - CHUNK_HEAD.size,
            message_end_time=self._last_ns,
            message_index_length=len(indices),
            message_index_offsets=offsets,
            message_start_time=self._begin_ns,
            uncompressed_size=self.size,
        )

    def restore(self) -> None:
        """After an error: make the chunk up to `end` again what it was after its last flush."""
        if self._head:
            write_at(self._file, self._position, self._head)
            write_at(self._file, self.end - len(END_OF_FRAME), END_OF_FRAME)

    def messages(self) -> dict[int, int]:
        """How many messages each channel has in it."""
        return {channel: len(entries) // 2 for channel, entries in self._index.items()}

    @property
    def _begin_ns(self) -> int:
        return min(self._first_ns, self._last_ns)  # 0 without messages

    def _encode_head(self, end: int, crc: int) -> bytes:
        length = end - self._position - RECORD_HEAD.size
        data = end - self._position - CHUNK_HEAD.size
        return CHUNK_HEAD.pack(
            Opcode.CHUNK, length, self._begin_ns, self._last_ns, self.size, crc,
            len(COMPRESSION), COMPRESSION, data,
        )  # fmt: skip


def _message_index(channel: int, entries: list[int]) -> bytes:
    """A message index record; the library's own takes a tenth of the recorder's time."""
    size = 8 * len(entries)
    return struct.pack(
        f"<BQHI{len(entries)}Q", Opcode.MESSAGE_INDEX, 6 + size, channel, size, *entries
    )


CHUNK_BYTES = 512 * 1024  # before compression; 1.4 s of a dive


class McapFile:
    """JSON messages, one channel per key, in zstd chunks.

    Attributes:
        flushed: messages that are certainly in the file.
        unflushed: messages that would be lost if the process were killed now.
            Neither counts views, because these can be computed from messages.
    """

    def __init__(self, path: Path) -> None:
        """
        Raises:
            FileExistsError: there is such a file already.
            OSError: it cannot be made; then there is none.
        """
        self.path = path
        self.flushed = 0
        self.unflushed = 0
        self._file = path.open("xb", buffering=0)
        self._end = 0  # [bytes] up to here the file is certainly written, without the open chunk
        self._chunk: OpenChunk | None = None
        self._summary = McapSummary()
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[str, int] = {}
        try:
            self._append(MAGIC + encoded(Header(profile="", library="lindy")))
        except OSError:
            self.discard()
            raise

    def metadata(self, name: str, entries: dict[str, str]) -> None:
        at, length = self._append_record(Metadata(name, entries))
        self._summary.metadata.append(MetadataIndex(at, length, name))

    def attach(
        self, name: str, media_type: str, data: bytes, log_ns: int = 0, create_ns: int = 0
    ) -> None:
        """Add a file as an attachment.

        Args:
            log_ns: [ns] UTC when it was attached; 0: unknown.
            create_ns: [ns] UTC when the file was written last; 0: unknown.
        """
        record = Attachment(create_ns, log_ns, name, media_type, data)
        at, length = self._append_record(record)
        index = AttachmentIndex(at, length, create_ns, log_ns, len(data), name, media_type)
        self._summary.attachments.append(index)

    def has_channel(self, key: str) -> bool:
        return key in self._channels

    def open_channel(self, key: str, schema_name: str, schema: bytes) -> None:
        """Before the first message of a key."""
        known = (schema_name, schema)
        if known not in self._schemas:
            self._schemas[known] = len(self._schemas) + 1
            record = Schema(self._schemas[known], schema, SchemaEncoding.JSONSchema, schema_name)
            self._summary.schemas.append(record)
            self._open_chunk().add(encoded(record))
        number = self._channels[key] = len(self._channels) + 1
        channel = Channel(number, key, MessageEncoding.JSON, {}, self._schemas[known])
        self._summary.channels.append(channel)
        self._open_chunk().add(encoded(channel))

    def write(
        self,
        key: str,
        data: bytes,
        log_ns: int,
        publish_ns: int,
        sequence: int,
        *,
        is_view: bool = False,
    ) -> None:
        """Add a message, or a view, to the chunk in progress. Times in ns UTC."""
        chunk = self._chunk or self._open_chunk()
        self.unflushed += not is_view
        chunk.add_message(self._channels[key], data, log_ns, publish_ns, sequence)
        if chunk.size > CHUNK_BYTES:
            self._close_chunk()

    def flush(self) -> None:
        """Give everything to the operating system: from then on it survives a crash of this
        process."""
        if self._chunk is not None:
            self._chunk.flush()
            self.flushed += self.unflushed
            self.unflushed = 0

    def finish(self) -> None:
        """Write the index, and close the file."""
        self._close_chunk()
        end = encoded(DataEnd(0))
        self._append(end + self._summary.encode(self._end + len(end)) + MAGIC)
        self._file.close()

    def abandon(self) -> None:
        """After an error: truncate the file to the last flush, end it there and close it."""
        with contextlib.suppress(OSError), self._file:
            if self._chunk is not None:
                self._chunk.restore()
                self._end = self._chunk.end
            self._file.truncate(self._end)
            self._append(ENDING)  # if even this fails: whole chunks can still be read

    def discard(self) -> None:
        """Close the file and remove it: it contains no messages."""
        self.abandon()
        with contextlib.suppress(OSError):
            self.path.unlink()

    def _open_chunk(self) -> OpenChunk:
        if self._chunk is None:
            self._chunk = OpenChunk(self._file, self._end)
        return self._chunk

    def _close_chunk(self) -> None:
        if self._chunk is None:
            return
        self.flush()
        index = self._chunk.finish()
        self._summary.add_chunk(index, self._chunk.messages())
        self._end = self._chunk.end + index.message_index_length
        self._chunk = None

    def _append_record(self, record: McapRecord) -> tuple[int, int]:
        """Write it behind everything else; returns its position and length [bytes]."""
        self._close_chunk()
        data, at = encoded(record), self._end
        self._append(data)
        return at, len(data)

    def _append(self, data: bytes) -> None:
        write_at(self._file, self._end, data)
        self._end += len(data)


class McapSummary:
    """What is in a file, for its end: what lets a reader find a time or a topic at once.

    The index of each chunk is kept encoded, some 350 bytes for 1.4 s of a dive, so that the
    recorder's memory hardly grows with its length.
    """

    def __init__(self) -> None:
        self.schemas: list[Schema] = []
        self.channels: list[Channel] = []
        self.attachments: list[AttachmentIndex] = []
        self.metadata: list[MetadataIndex] = []
        self._chunks: list[bytes] = []  # encoded
        self._counts: dict[int, int] = {}  # messages by channel
        self._first_ns, self._last_ns = 2**64 - 1, 0  # [ns] of the log times

    def add_chunk(self, chunk: ChunkIndex, messages: dict[int, int]) -> None:
        """
        Args:
            messages: how many there are in the chunk, by channel.
        """
        self._chunks.append(encoded(chunk))
        for channel, count in messages.items():
            self._counts[channel] = self._counts.get(channel, 0) + count
        self._first_ns = min(self._first_ns, chunk.message_start_time)
        self._last_ns = max(self._last_ns, chunk.message_end_time)

    def encode(self, position: int) -> bytes:
        """Summary, summary offsets and footer.

        Args:
            position: [bytes] where it will begin in the file.
        """
        described = (*self.schemas, *self.channels, self._statistics())
        indices = (*self.attachments, *self.metadata)
        records = [*map(encoded, described), *self._chunks, *map(encoded, indices)]
        offsets = bytearray()
        at = position
        for opcode, group in groupby(records, key=lambda record: record[0]):
            length = sum(map(len, group))
            offsets += encoded(SummaryOffset(opcode, at, length))
            at += length
        summary = b"".join(records) + offsets
        # The footer's own CRC covers its beginning.
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, position, at)
        return summary + encoded(Footer(position, at, zlib.crc32(summary + footer)))

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self.attachments),
            channel_count=len(self.channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=self._last_ns,
            message_start_time=min(self._first_ns, self._last_ns),
            metadata_count=len(self.metadata),
            schema_count=len(self.schemas),
        )
