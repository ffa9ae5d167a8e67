"""Streams of a recording as columns of numbers: a float64 array with one figure per message, NaN
where a message has none. Any field of any message can be one. A time in ns is exact for the first
104 days after the computer was started."""

from array import array
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from math import nan
from operator import attrgetter
from typing import Any, NamedTuple, cast

import msgspec
import numpy as np
from msgspec import UnsetType
from numpy.typing import NDArray

from messages.message import Message
from messages.topic import AnyTopic
from tools.recordings.recording import Recording

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Figures = tuple[float | None, ...]
# Columns of a stream: [ns] when a message was recorded; how many were before it, where that is not
# the order of its times.
ARRIVAL, PLACE = "arrival", "place"


class StreamColumns:
    """The figures of one stream in the order of their first column, a time.

    A word, such as a flight mode, is a number in its column; `said` asks for it.
    """

    def __init__(self, columns: Mapping[str, Array], words: Sequence[str] = ()) -> None:
        """
        Args:
            columns: shape (messages,) each.
            words: by the number that stands for each.
        """
        times = next(iter(columns.values()))
        if np.any(times[1:] < times[:-1]):
            order = np.argsort(times, kind="stable")
            columns = {**columns, PLACE: columns.get(PLACE, np.arange(float(len(times))))}
            columns = {name: column[order] for name, column in columns.items()}
        self.count = len(times)
        self.words = words
        self._columns = columns

    def __getitem__(self, name: str) -> Array:
        return self._columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    def said(self, name: str, *words: str) -> Flags:
        """(messages,) Is it one of these words?"""
        numbers = [number for number, word in enumerate(self.words) if word in words]
        return np.isin(self[name], numbers)

    def as_recorded(self) -> "StreamColumns":
        """The same in the order in which they were recorded."""
        return self.with_columns({PLACE: self[PLACE]}) if PLACE in self else self

    def rising(self) -> "StreamColumns":
        """As recorded, without messages whose time is no later than one before them."""
        arrived = self.as_recorded()
        times = arrived[next(iter(self._columns))]
        newer = times > np.append(-np.inf, np.maximum.accumulate(times)[:-1])
        columns = {name: column[newer] for name, column in arrived._columns.items()}
        return StreamColumns(columns, self.words)

    def with_columns(self, columns: Mapping[str, Array]) -> "StreamColumns":
        """The same with more columns, or others of those names, in the order of the first one."""
        return StreamColumns({**columns, **self._columns, **columns}, self.words)


class StreamFigures(NamedTuple):
    """Which figures of a stream are kept."""

    topic: AnyTopic
    # Of a message, such as `depth.value`; the first is a time. Names of times end in _ns.
    fields: tuple[str, ...]
    more: tuple[str, ...] = ()  # names of figures that are no field …
    figures: Callable[[Any], Figures] | None = None  # … and what makes them of a message

    @property
    def message(self) -> type[Message]:
        """What a recorded message is decoded as: a number that nobody reads costs time too."""
        kind = self.topic.message
        if self.figures is not None:
            return kind
        wanted = {path.partition(".")[0] for path in self.fields}
        read = [
            (field.name, field.type, msgspec.field(default=field.default))
            for field in msgspec.structs.fields(kind)
            if field.name in wanted and field.name not in Message.__struct_fields__
        ]
        base, name = (Message,), kind.__name__
        return cast(type[Message], msgspec.defstruct(name, read, bases=base, kw_only=True))


class Gathering:
    """Collects the figures of one stream, message by message."""

    def __init__(self, wanted: StreamFigures, *, arrival: bool = True) -> None:
        """
        Args:
            arrival: with the column of that name.
        """
        self._first, self._arrival = wanted.fields[0], arrival
        self._names = (*[ARRIVAL] * arrival, *wanted.fields, *wanted.more)
        self._read, self._figures = _reader(wanted.fields), wanted.figures
        self._rows = array("d")
        self._words: dict[str, int] = {}

    def add(self, message: object, arrival_ns: int = 0) -> None:
        row = self._read(message)
        if self._arrival:
            row = (arrival_ns, *row)
        if self._figures is not None:
            row += self._figures(message)
        try:
            numbers = array("d", row)
        except TypeError:  # None, or a word
            numbers = [v if isinstance(v, int | float) else self._number(v) for v in row]
        self._rows.extend(numbers)

    def columns(self, origin_ns: int = 0) -> StreamColumns:
        """Those so far.

        Args:
            origin_ns: [ns] from which its times count, but for `arrival`.
        """
        rows = np.frombuffer(self._rows).reshape(-1, len(self._names))
        found = {name: rows[:, place].copy() for place, name in enumerate(self._names)}
        for name in found:
            if name.endswith("_ns"):
                found[name] -= origin_ns
        return StreamColumns({self._first: found[self._first], **found}, [*self._words])

    def _number(self, word: str | UnsetType | None) -> float:
        """Of a word, or of what the message does not say."""
        return self._words.setdefault(word, len(self._words)) if isinstance(word, str) else nan


def _reader(paths: Sequence[str]) -> Callable[[object], tuple[Any, ...]]:
    """What gives these fields of a message, None where it has no such part."""
    get = attrgetter(*paths)
    if len(paths) == 1:
        return lambda message: (get(message),)
    runs = [
        (head, inner, attrgetter(*inner, *inner) if inner else None)
        for head, several in groupby(paths, lambda path: path.partition(".")[0])
        for inner in [[path.partition(".")[2] for path in several if "." in path]]
    ]

    def read(message: object) -> tuple[Any, ...]:
        try:
            return get(message)
        except AttributeError:  # a part of it is None, or left out
            pass
        row: list[Any] = []
        for head, inner, get_all in runs:
            part = getattr(message, head)
            if get_all is None:
                row.append(part)
            elif isinstance(part, UnsetType | None):
                row += [None] * len(inner)
            else:
                try:
                    row += get_all(part)[: len(inner)]  # of one path alone it is no tuple
                except AttributeError:
                    row += [_value(part, path) for path in inner]
        return tuple(row)

    return read


def _value(found: Any, path: str) -> Any:
    for name in path.split("."):
        found = getattr(found, name, None)
    return found


def read_streams(recording: Recording, wanted: Sequence[StreamFigures]) -> dict[str, StreamColumns]:
    """By key; of some there may be no message."""
    gathered = {each.topic.key: Gathering(each) for each in wanted}
    decoding = {each.topic.key: recording.decoding(each.topic.key, each.message) for each in wanted}
    for raw in recording.raw(gathered.__contains__):
        if (message := decoding[raw.key](raw.data)) is not None:
            gathered[raw.key].add(message, raw.log_ns)
    return {key: each.columns() for key, each in gathered.items()}
