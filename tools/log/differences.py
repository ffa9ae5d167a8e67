"""Where two recordings differ: which field of which topic, when first, and by how much."""

from collections.abc import Iterator

import msgspec
import numpy as np
from numpy.typing import NDArray

from tools.log.series import Array, DiveSeries, TopicSeries, Words


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


def differences(a: DiveSeries, b: DiveSeries, tolerance: float = 0.0) -> Differences:
    """
    Args:
        tolerance: [-] of the largest absolute value of a field.
    """
    zero_a, zero_b = zeros(a, b)
    counts: list[Counted] = []
    fields: list[FieldDifference] = []
    for key in sorted({*a.topics, *b.topics}):
        left, right = a.topics.get(key), b.topics.get(key)
        size = [0 if series is None else len(series.log_ns) for series in (left, right)]
        if size[0] != size[1]:
            counts.append(Counted(key, size[0], size[1]))
        if left is not None and right is not None:
            pair = TopicPair(key, left, right, zero_a, zero_b, a.words)
            fields += pair.differences(tolerance)
    return Differences(counts, sorted(fields, key=lambda field: (field.first_s, field.topic)))


def zeros(a: DiveSeries, b: DiveSeries) -> tuple[int, int]:
    """[ns] UTC in each from which seconds count: arming, if both were armed, else the beginning."""
    if a.armed_ns is not None and b.armed_ns is not None:
        return a.armed_ns, b.armed_ns
    return a.recording_ns, b.recording_ns


class TopicPair:
    """One topic in both. Where its messages were not recorded at the same instants, B is taken at
    those of A: numbers between two messages, everything else from the newest one."""

    def __init__(
        self, key: str, a: TopicSeries, b: TopicSeries, zero_a: int, zero_b: int, words: Words
    ) -> None:
        self._key, self._words = key, words
        self._a, self._b = a, b
        times_a, times_b = a.times(zero_a), b.times(zero_b)
        self._same_times = len(times_a) == len(times_b) and bool(np.all(times_a == times_b))
        inside = (times_a >= times_b[0]) & (times_a <= times_b[-1])
        self._inside = np.ones(len(times_a), bool) if self._same_times else inside
        self._times = times_a[self._inside]
        self._times_b = times_b

    def differences(self, tolerance: float) -> Iterator[FieldDifference]:
        names = {column.name for column in self._b.columns}
        for column in self._a.columns:
            if column.name in names and len(self._times):
                found = self._difference(column.name, column.kind, tolerance)
                if found is not None:
                    yield found

    def _difference(self, name: str, kind: str, tolerance: float) -> FieldDifference | None:
        a, b = self._a[name][self._inside], self._at_a(self._b[name], kind)
        by: Array = np.abs(a - b)
        size = float(np.max(np.abs(np.nan_to_num([a, b]))))
        within = 0.0 if kind in ("string", "boolean") else tolerance * size
        one_only = np.isnan(a) != np.isnan(b)
        differs: NDArray[np.bool_] = one_only | (by > within)
        if not np.any(differs):
            return None
        first = int(np.argmax(differs))
        number = kind in ("number", "integer") and bool(np.any(~np.isnan(by)))
        most = int(np.nanargmax(by)) if number else None
        return FieldDifference(
            topic=self._key,
            field=name,
            first_s=float(self._times[first]),
            a=self._shown(float(a[first]), kind),
            b=self._shown(float(b[first]), kind),
            largest=None if most is None else float(by[most]),
            largest_s=None if most is None else float(self._times[most]),
            share=float(np.mean(differs)),
        )

    def _at_a(self, values: Array, kind: str) -> Array:
        """B's values at the instants of A."""
        if self._same_times:
            return values
        if kind == "number" and not np.any(np.isnan(values)):
            return np.interp(self._times, self._times_b, values)
        newest = np.searchsorted(self._times_b, self._times, side="right") - 1
        return values[newest]

    def _shown(self, value: float, kind: str) -> float | str | None:
        if np.isnan(value):
            return None
        if kind == "string":
            return self._words.word(value)
        return str(value > 0.0).lower() if kind == "boolean" else value
