"""One MCAP file being written: https://mcap.dev/spec. Any method raises OSError when the disk
does; the file is then to be abandoned, and what was flushed can be read by any reader."""

import contextlib
import io
import struct
from pathlib import Path

from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

MAGIC = b"\x89MCAP0\r\n"  # first and last bytes of a whole file
# The shortest end a file may have: DataEnd and Footer without an index. A reader then reads on.
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
        self._flushed = 0  # [bytes] from here on nothing is sure
        self._writer = Writer(
            self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[str, int] = {}
        self._writer.start(library="lindy")

    def metadata(self, name: str, entries: dict[str, str]) -> None:
        self._writer.add_metadata(name, entries)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Put a file inside the file. Its times are left at 0: unknown."""
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
        """Close the chunk in progress and hand it to the operating system: from here on it
        survives the death of this process."""
        self._writer.flush()
        self._flushed = self._stream.tell()

    def finish(self) -> None:
        """Write the index and close the file."""
        self._writer.finish()
        self._stream.close()
        self._file.close()

    def abandon(self) -> None:
        """After an error: cut off what came after the last flush, end the file there and close
        it."""
        with contextlib.suppress(OSError):
            self._stream.close()  # tries to write what it still holds
        with contextlib.suppress(OSError), self._file as file:
            file.truncate(self._flushed)
            file.seek(self._flushed)
            file.write(ENDING)  # no room even for this: whole chunks can be read all the same

    def discard(self) -> None:
        """Close the file and remove it: nothing in it is worth keeping."""
        self.abandon()
        with contextlib.suppress(OSError):
            self.path.unlink()
