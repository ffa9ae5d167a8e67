"""Writes one MCAP file: https://mcap.dev/spec. Any method raises OSError when the disk fails; the
file must then be abandoned, and what was flushed can be read by any reader.

The mcap library's own writer closes a chunk at each flush, which made files larger and kept an
index in memory that grew with every flush. So only its records are used.
"""

import contextlib
import struct
import zlib
from itertools import groupby
from pathlib import Path

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

from services.recorder.io.open_chunk import ENDING, MAGIC, OpenChunk, encoded, write_at

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
