"""Streams of a recording as columns of numbers: a float64 array with one figure per message, NaN
where a message has none."""

from array import array
from collections.abc import Callable
from math import nan
from typing import Any, NamedTuple, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages.message import Message
from messages.topic import AnyTopic

Array = NDArray[np.float64]
Figures = tuple[float | None, ...]


class StreamColumns:
    """The figures of one stream in the order of their first column, a time."""

    def __init__(self, names: tuple[str, ...], rows: Array) -> None:
        """
        Args:
            rows: shape (messages, names).
        """
        times = rows[:, 0]
        if np.any(times[1:] < times[:-1]):
            rows = rows[np.argsort(times, kind="stable")]
        self.count = len(rows)
        self._columns = dict(zip(names, np.ascontiguousarray(rows.T), strict=True))

    def __getitem__(self, name: str) -> Array:
        return self._columns[name]


class Gathering:
    """Collects the rows of one stream.

    Args:
        figures: of a message, one for each name.
    """

    def __init__(self, names: tuple[str, ...], figures: Callable[[Any], Figures]) -> None:
        self._names = names
        self._figures = figures
        self._rows = array("d")

    def add(self, message: object, _log_ns: int = 0) -> None:
        figures = self._figures(message)
        self._rows.extend(
            [nan if figure is None else figure for figure in figures]
            if None in figures
            else cast(tuple[float, ...], figures)
        )

    def columns(self) -> StreamColumns:
        """The rows so far; no more can be added then."""
        return StreamColumns(self._names, np.frombuffer(self._rows).reshape(-1, len(self._names)))


class StreamFigures(NamedTuple):
    """Which figures of a stream are kept."""

    topic: AnyTopic
    names: tuple[str, ...]
    figures: Callable[[Any], Figures]
    fields: tuple[str, ...] = ()  # that `figures` reads, where the message has many more

    @property
    def message(self) -> type[Message]:
        """What a recorded message is decoded as: a number that nobody reads costs time too."""
        kind = self.topic.message
        if not self.fields:
            return kind
        read = [
            (field.name, field.type, msgspec.field(default=field.default))
            for field in msgspec.structs.fields(kind)
            if field.name in self.fields
        ]
        base, name = (Message,), kind.__name__
        return cast(type[Message], msgspec.defstruct(name, read, bases=base, kw_only=True))
