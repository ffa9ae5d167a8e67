"""The summary at the end of an MCAP file: what lets a reader find a time or a topic at once.

The index of each chunk is kept encoded, some 350 bytes for 1.4 s of a dive, so that the
recorder's memory hardly grows with its length.
"""

import struct
import zlib
from itertools import groupby

from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Footer,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from services.recorder.io.open_chunk import encoded


class McapSummary:
    """Collects what is in a file."""

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
