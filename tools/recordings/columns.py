"""Streams of a recording as columns of numbers: a float64 array with one figure per message, NaN
where a message has none. Any field of any message can be one."""

from array import array
from collections.abc import Callable, Mapping, Sequence
from math import nan
from operator import attrgetter
from typing import Any, NamedTuple, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages.message import Message
from messages.topic import AnyTopic
from tools.recordings.recording import Recording

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Figures = tuple[float | None, ...]
# Columns of every stream: [ns] when a message was recorded, and how many were before it.
ARRIVAL, PLACE = "arrival", "place"
UNKNOWN_NS = -(2**63)  # [ns] stands for a time that a message does not say


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
        return self.with_columns({PLACE: self[PLACE]})

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
    # Of a message, such as `depth.value`; the first is a time. Times, whose names end in _ns, are
    # exact over 104 days from the origin.
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

    def __init__(self, wanted: StreamFigures) -> None:
        self._times = [path for path in wanted.fields if path.endswith("_ns")]
        others = [path for path in wanted.fields if not path.endswith("_ns")]
        self._names = [*others, *wanted.more]
        self._read_times, self._read_others = _reader(self._times), _reader(others)
        self._figures = wanted.figures
        self._moments, self._numbers = array("q"), array("d")
        self._words: dict[str, int] = {}

    def add(self, message: object, arrival_ns: int = 0) -> None:
        moments = self._read_times(message)
        if None in moments:
            moments = [UNKNOWN_NS if moment is None else moment for moment in moments]
        self._moments.append(arrival_ns)
        self._moments.extend(moments)
        numbers = self._read_others(message)
        if self._figures is not None:
            numbers = (*numbers, *self._figures(message))
        try:
            more = array("d", numbers)
        except TypeError:  # None, or a word
            more = array("d", map(self._number, numbers))
        self._numbers.extend(more)

    def columns(self, origin_ns: int = 0, arrival_origin_ns: int = 0) -> StreamColumns:
        """Those so far.

        Args:
            origin_ns: [ns] from which its times count.
            arrival_origin_ns: [ns] the same of `arrival`.
        """
        moments = np.array(self._moments, dtype=np.int64).reshape(-1, 1 + len(self._times))
        numbers = np.array(self._numbers).reshape(len(moments), len(self._names))
        found: dict[str, Array] = {}
        for name, column in zip(self._times, moments.T[1:], strict=True):
            found[name] = np.where(column == UNKNOWN_NS, nan, column - origin_ns)
        found.update(zip(self._names, np.ascontiguousarray(numbers.T), strict=True))
        found[ARRIVAL] = (moments[:, 0] - arrival_origin_ns).astype(np.float64)
        found[PLACE] = np.arange(float(len(moments)))
        return StreamColumns(found, [*self._words])

    def _number(self, value: Any) -> float:
        if value is None or value is msgspec.UNSET:
            return nan
        if isinstance(value, str):
            return self._words.setdefault(value, len(self._words))
        return value


def _reader(paths: Sequence[str]) -> Callable[[object], Sequence[Any]]:
    """What gives these fields of a message, None where it has no such part."""
    if not paths:
        return lambda _: ()
    get = attrgetter(*paths)
    if len(paths) == 1:
        return lambda message: (get(message),)

    def read(message: object) -> Sequence[Any]:
        try:
            return get(message)
        except AttributeError:  # a part of it is None
            return [_value(message, path) for path in paths]

    return read


def _value(message: object, path: str) -> Any:
    found: Any = message
    for name in path.split("."):
        found = getattr(found, name, None)  # a part may be None, or left out
    return found


def read_streams(recording: Recording, wanted: Sequence[StreamFigures]) -> dict[str, StreamColumns]:
    """By key; of some there may be no message."""
    gathered = {each.topic.key: Gathering(each) for each in wanted}
    decoding = {each.topic.key: recording.decoding(each.topic.key, each.message) for each in wanted}
    for raw in recording.raw(gathered.__contains__):
        if (message := decoding[raw.key](raw.data)) is not None:
            gathered[raw.key].add(message, raw.log_ns)
    return {key: each.columns() for key, each in gathered.items()}
