"""Bags of ROS 1 (a .bag file) and ROS 2 (a folder with metadata.yaml, or a .db3 file of it), and
recordings (.mcap) of other programs with messages of ROS 1, of ROS 2 (CDR) and of JSON; by the
library rosbags. A topic that cannot be read is left out, which is said."""

import json
import re
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain, pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

from mcap.records import Channel, Metadata, Schema

from messages.units import Ns
from services.runtime.config.errors import LindyError
from tools.importing.log_file import LogFile, LogRow, LogSource, Wanted, library
from tools.importing.streams import STEP_NS
from tools.recordings.mcap_records import DIVE, Damage, Raw, records

METADATA = "metadata.yaml"
ROS1, ROS2, IDL = "ros1msg", "ros2msg", "ros2idl"  # languages of a type
LANGUAGES = {"ros1": (ROS1,), "cdr": (ROS2, IDL)}  # by the encoding of the messages
JSON = "json"
BETWEEN_IDL = "=" * 80 + "\nIDL: "

Decode = Callable[[bytes], Any]


class TypedTopic(NamedTuple):
    """One topic with messages of one type."""

    name: str
    kind: str  # of its messages, as ROS 2 calls it
    encoding: str  # of its messages
    language: str  # of the words; empty: there are none
    words: str  # what says its type


def is_rosbag(path: Path) -> bool:
    """Is it a bag of ROS 2?"""
    return path.suffix == ".db3" or (path / METADATA).is_file()


class TopicsLog(LogFile):
    """A log of topics that have types."""

    default_map = "ros"

    def _known(self, topics: Iterable[tuple[TypedTopic, int]]) -> dict[str, LogSource]:
        """Those that can be read, by name; the others are said.

        Args:
            topics: with the number of their messages.
        """
        found: dict[str, LogSource] = {}
        self._decoders: dict[TypedTopic, Decode] = {}
        for topic, count in topics:
            before = found[topic.name].messages if topic.name in found else 0
            if count and topic not in self._decoders:
                try:
                    self._decoders[topic] = decoder(topic)
                except LindyError as error:
                    self.say(f"{topic.name} ({topic.kind}) is left out: {error}")
                    continue
            found[topic.name] = LogSource(topic.kind, before + count)
        if not any(source.messages for source in found.values()):
            raise LindyError("; ".join([f"{self.path} holds no message to read", *self.remarks]))
        return found

    def _decoded(self, topic: TypedTopic, data: bytes, at_ns: Ns) -> Iterator[LogRow]:
        """Nothing of a message that cannot be read, which is counted."""
        try:
            fields = self._decoders[topic](data)
        except Exception:  # of whatever kind: rosbags does not say
            self.damaged[topic.name] += 1
        else:
            yield LogRow(topic.name, fields, at_ns)


class RosbagFile(TopicsLog):
    """One bag."""

    def sources(self) -> dict[str, LogSource]:
        with self._opened() as reader:
            return self._known((_topic(each), each.msgcount) for each in reader.connections)

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        self.damaged.clear()
        with self._opened() as reader:
            topics = {each.id: _topic(each) for each in reader.connections}
            known = [
                each
                for each in reader.connections
                if each.topic in wanted and topics[each.id] in self._decoders
            ]
            last_ns = 0
            try:
                for each, at_ns, data in _as_written(reader, known):
                    yield from self._decoded(topics[each.id], data, at_ns)
                    last_ns = at_ns
            except Exception as error:  # of whatever kind: rosbags does not say
                if not last_ns:
                    raise
                self.say(f"it is damaged, and what follows is left out: {_first_line(error)}")

    @contextmanager
    def _opened(self) -> Generator[Any]:
        """
        Raises:
            LindyError: rosbags is not installed, or the bag is damaged.
        """
        version = "rosbag2" if is_rosbag(self.path) else "rosbag1"
        try:
            with library(f"rosbags.{version}", "bags").Reader(self.path) as reader:
                yield reader
        except LindyError:
            raise
        except Exception as error:  # of whatever kind: where bytes are wrong, rosbags does not say
            said = str(error) or "a record cannot be read"
            why = re.sub(r"\('(.*?)',?\)", r"\1", said).rstrip(".")
            raise LindyError(
                f"{self.path} is damaged or was not finished: {why}; {_cure(self.path)}"
            ) from None


class McapLog(TopicsLog):
    """One recording."""

    def sources(self) -> dict[str, LogSource]:
        counts: Counter[int] = Counter()
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        damage = Damage()
        for found in records(self.path, damage=damage):
            match found:
                case Raw():
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
            self.say(said.partition(";")[0])
        self._topics = {number: _channel(each, schemas) for number, each in channels.items()}
        return self._known((topic, counts[number]) for number, topic in self._topics.items())

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        taken = {
            number: topic
            for number, topic in self._topics.items()
            if topic.name in wanted and topic in self._decoders
        }
        self.damaged.clear()
        for found in records(self.path):
            if isinstance(found, Raw) and found.channel_id in taken:
                yield from self._decoded(taken[found.channel_id], found.data, found.log_ns)


def _cure(path: Path) -> str:
    """What helps with a damaged bag."""
    if not is_rosbag(path):
        return "`rosbag reindex` mends what can be read"
    if path.suffix == ".db3":
        return f"`sqlite3 {path.name} .recover | sqlite3 new.db3` saves what can be read"
    return "`ros2 bag reindex` mends its metadata; or name one .db3 or .mcap file of it"


def _as_written(reader: Any, connections: list[Any]) -> Iterator[tuple[Any, Ns, bytes]]:
    """Messages by their times; of a bag of ROS 1 whose clock was set back, in the order of the
    file, as the times of a topic tell."""
    indexes: dict[int, list[Any]] = getattr(reader, "indexes", {})
    found = [sorted(indexes.get(each.id, []), key=_place) for each in connections]
    pairs = chain.from_iterable(pairwise(each) for each in found)
    if not any(later.time < before.time - STEP_NS for before, later in pairs):
        return reader.messages(connections)
    first = connections[0]  # its index may hold those of all: each message says whose it is
    indexes[first.id] = sorted(chain.from_iterable(found), key=_place)
    return reader.messages([first])


def _place(entry: Any) -> tuple[int, int]:
    return entry.chunk_pos, entry.offset


def _topic(connection: Any) -> TypedTopic:
    """Of a bag."""
    language = connection.msgdef.format.name  # NONE, MSG, IDL
    encoding = getattr(connection.ext, "serialization_format", "ros1")
    of_encoding = {"MSG": ROS1 if encoding == "ros1" else ROS2, "IDL": IDL}
    return TypedTopic(
        connection.topic,
        connection.msgtype,
        encoding,
        of_encoding.get(language, ""),
        connection.msgdef.data,
    )


def _channel(channel: Channel, schemas: Mapping[int, Schema]) -> TypedTopic:
    """Of a recording."""
    if (schema := schemas.get(channel.schema_id)) is None:
        kind = channel.message_encoding
        return TypedTopic(channel.topic, kind, channel.message_encoding, "", "")
    package, slash, name = schema.name.partition("/")
    kind = f"{package}/msg/{name}" if slash and "/" not in name else schema.name
    words = schema.data.decode(errors="replace")
    return TypedTopic(channel.topic, kind, channel.message_encoding, schema.encoding, words)


def decoder(topic: TypedTopic) -> Decode:
    """What makes fields of a message's bytes.

    Raises:
        LindyError: why it cannot be known.
    """
    kind = topic.kind
    if topic.encoding == JSON:
        return lambda data: json.loads(data, object_hook=lambda d: SimpleNamespace(**d))
    if topic.language and topic.language not in LANGUAGES.get(topic.encoding, ()):
        raise LindyError(
            f"it is encoded as {topic.encoding} with {topic.language}; expected ros1 with ros1msg, "
            f"cdr with ros2msg or ros2idl, or json"
        )
    typesys = library("rosbags.typesys", "messages of ROS")
    why: list[str] = []
    for others in (typesys.Stores.EMPTY, typesys.Stores.ROS2_HUMBLE):
        # Its own words first: a type of the same name may be another one elsewhere.
        try:
            store = typesys.get_typestore(others)
            store.register(_types(topic, typesys))
            store.get_msgdef(kind)
        except KeyError as error:
            name = str(error.args[0])
            part = f"{name}, a part of its type," if name != kind else "its type"
            is_wide = name.endswith("/wstring")
            why.append("its type has wstring" if is_wide else f"{part} is not in the log")
        except Exception as error:  # of whatever kind: rosbags does not say
            why.append(f"its type cannot be read: {_first_line(error)}")
        else:
            read = store.deserialize_ros1 if topic.encoding == "ros1" else store.deserialize_cdr
            return lambda data: read(data, kind)
    raise LindyError(why[0])


def _types(topic: TypedTopic, typesys: Any) -> dict[str, Any]:
    """Those that the log has words for."""
    if topic.language == IDL:
        found: dict[str, Any] = {}
        for words in topic.words.split(BETWEEN_IDL):
            is_first = not topic.words.startswith(BETWEEN_IDL)
            found |= typesys.get_types_from_idl(words if is_first else words.partition("\n")[2])
        return found
    # A log that did not find the words of a type has none; some are written on Windows.
    words = topic.words.replace("\r\n", "\n")
    return typesys.get_types_from_msg(words, topic.kind) if words.strip() else {}


def _first_line(error: Exception) -> str:
    return (str(error) or type(error).__name__).partition("\n")[0].rstrip(".:")
