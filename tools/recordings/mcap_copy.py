"""A new MCAP file made of records of others, for any reader: written by the mcap library."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import Writer

from services.recorder.foxglove.channel import is_view
from tools.fresh import new_file
from tools.recordings.mcap_records import Described, Raw

CHUNK_BYTES = 512 * 1024  # before compression


class McapCopy:
    """Takes records in the order of the files they are from. Call `next_file` before each file:
    every file has its own numbers of schemas and channels."""

    def __init__(self, writer: Writer) -> None:
        self.messages = 0  # without what is only drawn for Foxglove, as everywhere
        self.is_empty = True  # also of that
        self.orphans = 0  # messages of a channel that the file does not describe; left out
        self.attachments = 0
        self._writer = writer
        self._schemas: dict[int, Schema] = {}  # of this file
        self._channels: dict[int, Channel] = {}
        self._numbers: dict[int, int] = {}  # of its channels in the copy
        self._known_schemas: dict[tuple[str, str, bytes], int] = {}  # in the copy
        self._known_channels: dict[tuple[str, str, int], int] = {}
        self._attached: set[tuple[str, bytes]] = set()
        self._views: set[int] = set()  # channels in the copy

    def next_file(self) -> None:
        self._schemas, self._channels, self._numbers = {}, {}, {}

    def add(self, record: Raw | Described) -> None:
        """Schemas and channels are written with the first message that needs them."""
        if isinstance(record, Raw):
            self._message(record)
        elif isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channels[record.id] = record
            self._numbers.pop(record.id, None)
        elif isinstance(record, Attachment):
            self._attachment(record)
        else:
            self.metadata(record)

    def metadata(self, record: Metadata) -> None:
        self._writer.add_metadata(record.name, record.metadata)

    def _attachment(self, record: Attachment) -> None:
        """Once, although every part of a dive carries it."""
        if (known := (record.name, record.data)) in self._attached:
            return
        self._attached.add(known)
        self.attachments += 1
        self._writer.add_attachment(
            record.create_time, record.log_time, record.name, record.media_type, record.data
        )

    def _message(self, message: Raw) -> None:
        number = self._numbers.get(message.channel_id)
        if number is None:
            channel = self._channels.get(message.channel_id)
            if channel is None:
                self.orphans += 1
                return
            number = self._numbers[message.channel_id] = self._channel(channel)
        self.messages += number not in self._views
        self.is_empty = False
        self._writer.add_message(
            number, message.log_ns, message.data, message.publish_ns, message.sequence
        )

    def _channel(self, channel: Channel) -> int:
        schema = self._schemas.get(channel.schema_id)
        schema_number = 0 if schema is None else self._schema(schema)
        key = (channel.topic, channel.message_encoding, schema_number)
        if key not in self._known_channels:
            self._known_channels[key] = self._writer.register_channel(
                channel.topic, channel.message_encoding, schema_number, channel.metadata
            )
            if is_view(channel.topic):
                self._views.add(self._known_channels[key])
        return self._known_channels[key]

    def _schema(self, schema: Schema) -> int:
        key = (schema.name, schema.encoding, schema.data)
        if key not in self._known_schemas:
            self._known_schemas[key] = self._writer.register_schema(*key)
        return self._known_schemas[key]


@contextmanager
def new_mcap(path: Path) -> Generator[McapCopy]:
    """A new file. Errors as of `new_file`."""
    with new_file(path) as file:
        writer = Writer(file, chunk_size=CHUNK_BYTES)
        writer.start(profile="", library="lindy")
        yield McapCopy(writer)
        writer.finish()
