"""Writes one MCAP file: https://mcap.dev/spec. Any method raises OSError when the disk fails; the
file must then be abandoned, and what was flushed can be read by any reader."""

import contextlib
import io
import struct
from pathlib import Path

from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

MAGIC = b"\x89MCAP0\r\n"  # first and last bytes of a whole file
# The shortest valid end of a file: DataEnd and Footer without an index.
ENDING = struct.pack("<BQI", 0x0F, 4, 0) + struct.pack("<BQQQI", 0x02, 20, 0, 0, 0) + MAGIC
CHUNK_BYTES = 256 * 1024  # before compression; a flush closes a chunk earlier


class McapFile:
    """JSON messages, one channel per key, in zstd chunks."""

    def __init__(self, path: Path) -> None:
        """
        Raises:
            FileExistsError: there is such a file already.
        """
        self.path = path
        self._file = path.open("xb", buffering=0)
        self._stream = io.BufferedWriter(io.FileIO(self._file.fileno(), "w", closefd=False))
        self._flushed = 0  # [bytes] up to here the file is certainly written
        self._writer = Writer(
            self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[str, int] = {}
        self._writer.start(library="lindy")

    def metadata(self, name: str, entries: dict[str, str]) -> None:
        self._writer.add_metadata(name, entries)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file as an attachment. Its times are 0: unknown."""
        self._writer.add_attachment(0, 0, name, media_type, data)

    def has_channel(self, key: str) -> bool:
        return key in self._channels

    def open_channel(self, key: str, schema_name: str, schema: bytes) -> None:
        """Before the first message of a key."""
        known = (schema_name, schema)
        if known not in self._schemas:
            self._schemas[known] = self._writer.register_schema(
                schema_name, SchemaEncoding.JSONSchema, schema
            )
        self._channels[key] = self._writer.register_channel(
            key, MessageEncoding.JSON, self._schemas[known]
        )

    def write(self, key: str, data: bytes, log_ns: int, publish_ns: int, sequence: int) -> None:
        """Add a message to the chunk in progress. Times in ns UTC."""
        self._writer.add_message(self._channels[key], log_ns, data, publish_ns, sequence)

    def flush(self) -> None:
        """Close the chunk in progress and give it to the operating system: from then on it
        survives a crash of this process."""
        self._writer.flush()
        self._flushed = self._stream.tell()

    def finish(self) -> None:
        """Write the index and close the file."""
        self._writer.finish()
        self._stream.close()
        self._file.close()

    def abandon(self) -> None:
        """After an error: truncate the file to the last flush, end it there and close it."""
        with contextlib.suppress(OSError):
            self._stream.close()  # tries to write its buffer
        with contextlib.suppress(OSError), self._file as file:
            file.truncate(self._flushed)
            file.seek(self._flushed)
            file.write(ENDING)  # if even this fails: whole chunks can still be read

    def discard(self) -> None:
        """Close the file and remove it: it contains no messages."""
        self.abandon()
        with contextlib.suppress(OSError):
            self.path.unlink()
