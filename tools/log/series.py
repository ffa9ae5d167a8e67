"""Recordings as columns of numbers over time, topic by topic, and where two of them differ: which
field, when first, and by how much.

Words become numbers of their own: the same word the same number in every recording. None is NaN.
"""

from array import array
from collections.abc import Iterator
from hashlib import sha256
from math import nan
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from messages import topics
from messages.topic import AnyTopic
from services.recorder.foxglove.channel import is_view
from tools.log.flatten import DECODE, Flattening, Kind, Row
from tools.recordings.mcap_records import StoredMessage
from tools.recordings.recording import Recording

Array = NDArray[np.float64]
LONGEST = 1000  # letters of a word; a longer one, as a picture is, is kept as its checksum
# Names of fields that tell messages and processes apart, and are never the same twice by the clock.
IDENTIFIERS = ("seq", "instance", "pid", "id", "source")


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


class TopicSeries:
    """What one topic says over time: the columns that can be compared."""

    def __init__(self, flattening: Flattening) -> None:
        self.flattening = flattening
        self.log_ns = array("q")  # [ns] UTC of arrival
        columns = enumerate(flattening.columns)
        self._places = {c.name: place for place, c in columns if _is_compared(c.name)}
        self.kinds: dict[str, Kind] = {
            name: flattening.columns[place].kind for name, place in self._places.items()
        }
        self._values = {name: array("d") for name in self._places}

    def add(self, row: Row, log_ns: int, words: Words) -> None:
        """
        Raises:
            OverflowError, TypeError: it is no number that a message of ours has.
        """
        numbers = [words.number(row[place]) for place in self._places.values()]
        self.log_ns.append(log_ns)
        for number, values in zip(numbers, self._values.values(), strict=True):
            values.append(number)

    def times(self, origin_ns: int) -> Array:
        """[s] since the origin."""
        return (np.asarray(self.log_ns) - origin_ns) / 1e9

    def __getitem__(self, name: str) -> Array:
        """
        Raises:
            KeyError: it has no such column.
        """
        return np.asarray(self._values[name])


class DiveSeries:
    """All topics of a recording."""

    def __init__(self, recording: Recording, words: Words) -> None:
        self.topics: dict[str, TopicSeries] = {}
        self.words = words
        self.unread = 0  # messages that are not JSON, or do not fit their topic
        for file in recording.files:
            self._read(recording, file)
        self.recording_ns = recording.origin_ns() or 0  # [ns] UTC
        self.armed_ns: int | None = None  # [ns] UTC; None: never
        if (armed := self.of(topics.STATUS, "armed")) is not None and np.any(armed[1] > 0.0):
            self.armed_ns = int(armed[0][int(np.argmax(armed[1] > 0.0))])

    @property
    def unreadable(self) -> list[str]:
        """A sentence, if there are messages that could not be read."""
        return [f"{self.unread} messages could not be read"] if self.unread else []

    def of(self, topic: AnyTopic, column: str) -> tuple[Array, Array] | None:
        """(times [ns UTC], values); None: it is not in the recording."""
        series = self.topics.get(topic.key)
        if series is None or column not in series.kinds:
            return None
        return np.asarray(series.log_ns, dtype=np.float64), series[column]

    def _read(self, recording: Recording, file: Path) -> None:
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


def _is_read(channel: Channel) -> bool:
    """What is recorded for Foxglove was computed from the rest."""
    return channel.message_encoding == "json" and not is_view(channel.topic)


def _is_compared(name: str) -> bool:
    field = name.rpartition(".")[2]
    return field not in IDENTIFIERS and not field.endswith("_ns")


class FieldDifference(msgspec.Struct):
    """A field that is not the same in both."""

    topic: str
    field: str
    first_s: float  # [s] when it differs first …
    a: float | str | None  # … and what it is then in A …
    b: float | str | None  # … and in B; None: there is no value
    largest: float | None  # largest difference of two numbers, in the field's own unit
    largest_s: float | None  # [s] when that was
    share: float  # [-] of the compared instants


class Counted(msgspec.Struct):
    """A topic with another number of messages."""

    topic: str
    a: int
    b: int


class Differences(msgspec.Struct):
    counts: list[Counted]
    fields: list[FieldDifference]  # the one that differs first is the first

    @property
    def none(self) -> bool:
        return not self.counts and not self.fields


def zeros(a: DiveSeries, b: DiveSeries) -> tuple[int, int]:
    """[ns] UTC in each from which seconds count: arming, if both were armed, else the beginning."""
    if a.armed_ns is not None and b.armed_ns is not None:
        return a.armed_ns, b.armed_ns
    return a.recording_ns, b.recording_ns


def differences(a: DiveSeries, b: DiveSeries, tolerance: float = 0.0) -> Differences:
    """
    Args:
        tolerance: [-] of the largest absolute value of a field.
    """
    counts: list[Counted] = []
    fields: list[FieldDifference] = []
    for key in sorted({*a.topics, *b.topics}):
        left, right = a.topics.get(key), b.topics.get(key)
        size = [0 if series is None else len(series.log_ns) for series in (left, right)]
        if size[0] != size[1]:
            counts.append(Counted(key, size[0], size[1]))
        if left is not None and right is not None:
            fields += topic_differences(key, (left, right), zeros(a, b), a.words, tolerance)
    return Differences(counts, sorted(fields, key=lambda field: (field.first_s, field.topic)))


def topic_differences(
    key: str,
    both: tuple[TopicSeries, TopicSeries],
    zero_ns: tuple[int, int],
    words: Words,
    tolerance: float,
) -> Iterator[FieldDifference]:
    """One topic in A and in B. Where its messages were not recorded at the same instants, B is
    taken at those of A: numbers between two messages, everything else from the newest one.

    Args:
        zero_ns: [ns] UTC from which seconds count in each.
    """
    a, b = both
    times_a, times_b = a.times(zero_ns[0]), b.times(zero_ns[1])
    same_times = np.array_equal(times_a, times_b)
    inside = (times_a >= times_b[0]) & (times_a <= times_b[-1])
    times = times_a[inside]

    def at_a(values: Array, kind: Kind) -> Array:
        if same_times:
            return values[inside]
        if kind == "number" and not np.any(np.isnan(values)):
            return np.interp(times, times_b, values)
        return values[np.searchsorted(times_b, times, side="right") - 1]

    def shown(value: float, kind: Kind) -> float | str | None:
        if np.isnan(value):
            return None
        if kind == "string":
            return words.word(value)
        return str(value > 0.0).lower() if kind == "boolean" else value

    for name, kind in a.kinds.items():
        if name not in b.kinds or not len(times):
            continue
        left, right = a[name][inside], at_a(b[name], kind)
        by: Array = np.abs(left - right)
        size = float(np.max(np.abs(np.nan_to_num([left, right]))))
        within = 0.0 if kind in ("string", "boolean") else tolerance * size
        one_only = np.isnan(left) != np.isnan(right)
        differs: NDArray[np.bool_] = one_only | (by > within)
        if not np.any(differs):
            continue
        first = int(np.argmax(differs))
        number = kind in ("number", "integer") and bool(np.any(~np.isnan(by)))
        most = int(np.nanargmax(by)) if number else None
        yield FieldDifference(
            topic=key,
            field=name,
            first_s=float(times[first]),
            a=shown(float(left[first]), kind),
            b=shown(float(right[first]), kind),
            largest=None if most is None else float(by[most]),
            largest_s=None if most is None else float(times[most]),
            share=float(np.mean(differs)),
        )
