"""A recording as columns of numbers over time, topic by topic.

Words become numbers of their own: the same word the same number in every recording. None is NaN.
"""

from array import array
from hashlib import sha256
from math import nan
from typing import Any

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from messages import topics
from messages.topic import AnyTopic
from services.recorder.foxglove.channel import is_view
from tools.log.flatten import DECODE, Flattening, Row, TableColumn
from tools.recordings.mcap_records import StoredMessage
from tools.recordings.recording import Recording

Array = NDArray[np.float64]
LONGEST = 1000  # letters of a word; a longer one, as a picture is, is kept as its checksum
# Names of fields that tell messages and processes apart, and are never the same twice by the clock.
IDENTIFIERS = ("seq", "instance", "pid", "id", "source")


class TopicSeries:
    """What one topic says over time."""

    def __init__(self, flattening: Flattening) -> None:
        self.flattening = flattening
        self.log_ns = array("q")  # [ns] UTC of arrival
        columns = enumerate(flattening.columns)
        self._kept = [(place, column) for place, column in columns if _is_compared(column)]
        self._values = [array("d") for _ in self._kept]

    def add(self, row: Row, log_ns: int, words: "Words") -> None:
        """
        Raises:
            OverflowError, TypeError: it is no number that a message of ours has.
        """
        numbers = [words.number(row[place]) for place, _ in self._kept]
        self.log_ns.append(log_ns)
        for number, values in zip(numbers, self._values, strict=True):
            values.append(number)

    @property
    def columns(self) -> list[TableColumn]:
        return [column for _, column in self._kept]

    def times(self, origin_ns: int) -> Array:
        """[s] since the origin."""
        return (np.asarray(self.log_ns) - origin_ns) / 1e9

    def __getitem__(self, name: str) -> Array:
        """
        Raises:
            KeyError: it has no such column.
        """
        for column, values in zip(self.columns, self._values, strict=True):
            if column.name == name:
                return np.asarray(values)
        raise KeyError(name)


class Words:
    """Every word has a number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}
        self._words: list[str] = []

    def number(self, value: Any) -> float:
        if value is None:
            return nan
        if isinstance(value, str):
            value = value if len(value) <= LONGEST else sha256(value.encode()).hexdigest()
            known = self._numbers.setdefault(value, len(self._words))
            if known == len(self._words):
                self._words.append(value)
            return float(known)
        return float(value)

    def word(self, number: float) -> str:
        return self._words[int(number)]


class DiveSeries:
    """All topics of a recording."""

    def __init__(self, recording: Recording, words: Words) -> None:
        self.topics: dict[str, TopicSeries] = {}
        self.words = words
        self.unread = 0  # messages that are not JSON, or do not fit their topic
        for file in recording.files:
            self._read(recording, file)
        self.recording_ns = recording.origin_ns() or 0  # [ns] UTC
        self.armed_ns = self._first_armed()  # [ns] UTC; None: never

    @property
    def unreadable(self) -> list[str]:
        """A sentence, if there are messages that could not be read."""
        return [f"{self.unread} messages could not be read"] if self.unread else []

    def of(self, topic: AnyTopic, column: str) -> tuple[Array, Array] | None:
        """(times [ns UTC], values); None: it is not in the recording."""
        series = self.topics.get(topic.key)
        if series is None or all(each.name != column for each in series.columns):
            return None
        return np.asarray(series.log_ns, dtype=np.float64), series[column]

    def _read(self, recording: Recording, file: Any) -> None:
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for record in recording.records(file):
            if isinstance(record, StoredMessage):
                channel = channels.get(record.channel_id)
                if channel is not None:
                    self._add(record, channel.topic, schemas.get(channel.schema_id))
            elif isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel) and _is_read(record):
                channels[record.id] = record

    def _add(self, message: StoredMessage, key: str, schema: Schema | None) -> None:
        try:
            tree = DECODE(message.data)
            series = self.topics.get(key)
            if series is None:
                series = self.topics[key] = TopicSeries(Flattening.by(schema, [], tree))
            series.add(series.flattening.row(tree), message.log_ns, self.words)
        except (ValueError, TypeError, RecursionError, OverflowError):  # also msgspec's
            self.unread += 1

    def _first_armed(self) -> int | None:
        armed = self.of(topics.STATUS, "armed")
        if armed is None or not np.any(armed[1] > 0.0):
            return None
        return int(armed[0][int(np.argmax(armed[1] > 0.0))])


def _is_read(channel: Channel) -> bool:
    """What is recorded for Foxglove was computed from the rest."""
    return channel.message_encoding == "json" and not is_view(channel.topic)


def _is_compared(column: TableColumn) -> bool:
    field = column.name.rpartition(".")[2]
    return field not in IDENTIFIERS and not field.endswith("_ns")
