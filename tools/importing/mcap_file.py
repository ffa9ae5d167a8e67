"""Recordings (.mcap) of other programs: messages of ROS 1, of ROS 2 (CDR) and of JSON."""

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mcap.records import Channel, Metadata, Schema

from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.importing.log_file import MCAP, LogRow, LogSource, Wanted, getter, refuse_other
from tools.recordings.mcap_records import DIVE, Damage, StoredMessage, records

Decode = Callable[[bytes], Any]
ROS1, ROS2 = ("ros1", "ros1msg"), ("cdr", "ros2msg")  # encodings of messages and of their schema
JSON = "json"


def is_mcap(path: Path) -> bool:
    return path.suffix.lower() == ".mcap"


class McapLog:
    """One recording."""

    default_map = "ros"
    getter = staticmethod(getter)

    def __init__(self, path: Path) -> None:
        """
        Raises:
            LindyError: it is no MCAP file.
        """
        self.remarks: list[str] = []
        self._path = path
        refuse_other(path, MCAP, "an MCAP file")

    def sources(self) -> dict[str, LogSource]:
        counts: Counter[int] = Counter()
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        damage = Damage()
        for found in records(self._path, damage=damage):
            match found:
                case StoredMessage():
                    counts[found.channel_id] += 1
                case Schema():
                    schemas[found.id] = found
                case Channel():
                    channels[found.id] = found
                case Metadata(name=name) if name == DIVE:
                    raise LindyError(f"{self._path} is a recording of Lindy already")
                case _:
                    pass
        for said in damage.in_words(self._path.name):
            self.remarks += [said.partition(";")[0]]
        if not counts:
            raise LindyError(f"{self._path} holds no messages")
        sources: dict[str, LogSource] = {}
        for number, channel in channels.items():
            schema = schemas.get(channel.schema_id)
            before = sources[channel.topic].messages if channel.topic in sources else 0
            kind = _kind(schema) if schema else channel.message_encoding
            sources[channel.topic] = LogSource(kind, before + counts[number])
        return sources

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        schemas: dict[int, Schema] = {}
        taken: dict[int, tuple[str, Decode]] = {}  # topic, by number of the channel
        for found in records(self._path):
            match found:
                case StoredMessage() if found.channel_id in taken:
                    topic, decode = taken[found.channel_id]
                    try:
                        fields = decode(found.data)
                    except Exception as error:  # of whatever kind: rosbags does not say
                        why = str(error).rstrip(".") or type(error).__name__
                        raise LindyError(
                            f"{self._path}: a message of {topic} is not of its type: {why}"
                        ) from None
                    yield LogRow(topic, fields, found.log_ns)
                case Schema():
                    schemas[found.id] = found
                case Channel() if found.topic in wanted and found.id not in taken:
                    taken[found.id] = found.topic, self._decoder(found, schemas)
                case _:
                    pass

    def _decoder(self, channel: Channel, schemas: dict[int, Schema]) -> Decode:
        """
        Raises:
            LindyError: the messages are in an encoding that is not read, or their type is none.
        """
        if channel.message_encoding == JSON:
            return lambda data: json.loads(data, object_hook=lambda d: SimpleNamespace(**d))
        schema = schemas.get(channel.schema_id)
        encodings = channel.message_encoding, schema.encoding if schema else ""
        if schema is None or encodings not in (ROS1, ROS2):
            raise LindyError(
                f"{self._path}: {channel.topic} is encoded as {' with '.join(encodings)}; expected "
                f"ros1 with ros1msg, cdr with ros2msg, or json"
            )
        try:
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore
        except ModuleNotFoundError:
            raise LindyError(
                f"messages of ROS need rosbags, which is missing: {how_to_install('import')}"
            ) from None
        kind = _kind(schema)
        try:
            # Their own words alone: a type of the same name may be another one elsewhere.
            store = get_typestore(Stores.EMPTY)
            types: Mapping[str, Any] = get_types_from_msg(schema.data.decode(), kind)
            store.register(types)
        except Exception as error:  # of whatever kind: rosbags does not say
            raise LindyError(f"{self._path}: {kind} is not a type: {error}") from None
        read = store.deserialize_ros1 if encodings == ROS1 else store.deserialize_cdr
        return lambda data: read(data, kind)


def _kind(schema: Schema) -> str:
    """As ROS 2 calls it: sensor_msgs/Imu of ROS 1 is sensor_msgs/msg/Imu."""
    package, slash, name = schema.name.partition("/")
    return f"{package}/msg/{name}" if slash and "/" not in name else schema.name
