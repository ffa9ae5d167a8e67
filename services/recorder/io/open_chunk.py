"""The chunk of an MCAP file that is being filled, readable after every flush.

Large chunks are small and cheap, but a killed recorder may lose only a quarter of a second. So the
zstd frame of a chunk is written piece by piece: a flush appends what is new, ends the frame, and
writes the sizes into the head of the chunk. The file then consists of whole records, and any reader
can read it. The next flush overwrites the end of the frame and continues it.
"""

import io
import struct
import zlib
from typing import IO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, McapRecord

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
