"""Bags of ROS 1 (a .bag file) and ROS 2 (a folder with metadata.yaml), and recordings (.mcap) of
other programs with messages of ROS 1, of ROS 2 (CDR) and of JSON; by the library rosbags."""

import json
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mcap.records import Channel, Metadata, Schema

from services.runtime.config.errors import LindyError
from tools.importing.log_file import MCAP, ROSBAG, LogFile, LogRow, LogSource, Wanted, library
from tools.recordings.mcap_records import DIVE, Damage, StoredMessage, records

METADATA = "metadata.yaml"
ROS1, ROS2 = ("ros1", "ros1msg"), ("cdr", "ros2msg")  # encodings of messages and of their schema
JSON = "json"

Decode = Callable[[bytes], Any]


def is_rosbag(path: Path) -> bool:
    """By its name; what is in it is read later."""
    return path.suffix in (".bag", ".db3") or (path / METADATA).is_file()


class RosbagFile(LogFile):
    """One bag."""

    default_map = "ros"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        if path.suffix == ".db3":
            raise LindyError(
                f"{path}: a bag of ROS 2 is the folder with {METADATA}; name that folder"
            )
        if path.is_file():
            self.refuse_other(ROSBAG, "a bag of ROS 1")

    def sources(self) -> dict[str, LogSource]:
        with self._opened() as reader:
            found: dict[str, LogSource] = {}
            for each in reader.connections:
                before = found[each.topic].messages if each.topic in found else 0
                found[each.topic] = LogSource(each.msgtype, before + each.msgcount)
        if not any(source.messages for source in found.values()):
            raise LindyError(f"{self.path} holds no messages")
        return found

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        with self._opened() as reader:
            connections = [each for each in reader.connections if each.topic in wanted]
            for connection, at_ns, data in reader.messages(connections):
                fields: Any = reader.deserialize(data, connection.msgtype)
                yield LogRow(connection.topic, fields, at_ns)

    @contextmanager
    def _opened(self) -> Generator[Any]:
        """
        Raises:
            LindyError: rosbags is not installed, or the bag is damaged.
        """
        highlevel, typesys = (
            library(f"rosbags.{part}", "bags") for part in ("highlevel", "typesys")
        )
        try:
            typestore = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
            with highlevel.AnyReader([self.path], default_typestore=typestore) as reader:
                yield reader
        except Exception as error:  # of whatever kind: where bytes are wrong, rosbags does not say
            why = (str(error) or "a record cannot be read").rstrip(".")
            raise LindyError(
                f"{self.path} is damaged, was not finished or has types that are not in it: "
                f"{why}; `rosbag reindex` or `ros2 bag reindex` mends what can be read"
            ) from None


class McapLog(LogFile):
    """One recording."""

    default_map = "ros"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.refuse_other(MCAP, "an MCAP file")

    def sources(self) -> dict[str, LogSource]:
        counts: Counter[int] = Counter()
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        damage = Damage()
        for found in records(self.path, damage=damage):
            match found:
                case StoredMessage():
                    counts[found.channel_id] += 1
                case Schema():
                    schemas[found.id] = found
                case Channel():
                    channels[found.id] = found
                case Metadata(name=name) if name == DIVE:
                    raise LindyError(f"{self.path} is a recording of Lindy already")
                case _:
                    pass
        for said in damage.in_words(self.path.name):
            self.remarks += [said.partition(";")[0]]
        if not counts:
            raise LindyError(f"{self.path} holds no messages")
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
        for found in records(self.path):
            match found:
                case StoredMessage() if found.channel_id in taken:
                    topic, decode = taken[found.channel_id]
                    try:
                        fields = decode(found.data)
                    except Exception as error:  # of whatever kind: rosbags does not say
                        why = str(error).rstrip(".") or type(error).__name__
                        raise LindyError(
                            f"{self.path}: a message of {topic} is not of its type: {why}"
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
                f"{self.path}: {channel.topic} is encoded as {' with '.join(encodings)}; expected "
                f"ros1 with ros1msg, cdr with ros2msg, or json"
            )
        typesys, kind = library("rosbags.typesys", "messages of ROS"), _kind(schema)
        try:
            # Their own words alone: a type of the same name may be another one elsewhere.
            store = typesys.get_typestore(typesys.Stores.EMPTY)
            store.register(typesys.get_types_from_msg(schema.data.decode(), kind))
        except Exception as error:  # of whatever kind: rosbags does not say
            raise LindyError(f"{self.path}: {kind} is not a type: {error}") from None
        read = store.deserialize_ros1 if encodings == ROS1 else store.deserialize_cdr
        return lambda data: read(data, kind)


def _kind(schema: Schema) -> str:
    """As ROS 2 calls it: sensor_msgs/Imu of ROS 1 is sensor_msgs/msg/Imu."""
    package, slash, name = schema.name.partition("/")
    return f"{package}/msg/{name}" if slash and "/" not in name else schema.name
