"""`lindy log compare`: two recordings side by side: figures, and where their messages differ: which
field, when first, and by how much."""

from array import array
from collections.abc import Iterator, Sequence
from hashlib import sha256
from math import nan
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.analysis.dive import read_dive
from tools.choices import Json
from tools.exit_status import DONE, ERROR, LOST
from tools.log.flatten import FlattenedRows, Kind, Row, TableColumn
from tools.recordings.columns import Array
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording
from tools.report.report import Extras, report_on
from tools.report.summary import is_loss
from tools.text_table import aligned, counted

SHOWN = 20  # fields on the screen; all of them are in the JSON
ROUNDED = 1e-9  # [-] of a figure, or of a number between two messages: no difference
LONGEST = 1000  # letters of a word; a longer one, as a picture is, is kept as its checksum
# Names of fields that tell messages and processes apart, and are never the same twice by the clock.
IDENTIFIERS = ("seq", "instance", "pid", "id", "source")


class ComparedFigure(msgspec.Struct):
    name: str
    unit: str
    a: float | None  # None: not measurable on that dive
    b: float | None


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


def compare(a: Path, b: Path, /, *, json: Json = False) -> int:
    """Print what differs between two recordings, and when first.

    And by how much, by stream and field. A and B are dives' folders or MCAP files, of one vehicle.
    Times are seconds since arming, or, where one was never armed, since the recording began. Exit
    status 1: they differ; 3: one is damaged or was not finished.

    Example: lindy log compare dives/before dives/after
    """
    left, right = open_recording(a), open_recording(b)
    names = [each.metadata("dive").get("vehicle", "") or "unknown" for each in (left, right)]
    if names[0] != names[1]:
        raise LindyError(
            f"{left.files[0]} is of the vehicle {names[0]}, {right.files[0]} of {names[1]}: "
            f"compare two dives of one vehicle"
        )
    with reading("comparing", left.size + right.size) as advance:
        words = Words()
        left.advance = advance
        series_a = DiveSeries(left, words)
        right.advance = lambda at: advance(left.size + at)
        series_b = DiveSeries(right, words)
    damage = list[str]()
    for path, recording, series in ((a, left, series_a), (b, right, series_b)):
        if not series.topics:
            raise recording.empty(path)
        unread = [f"{counted(series.unread, 'message')} could not be read"] if series.unread else []
        damage += [f"{path}: {said}" for said in [*recording.damage, *unread]]
    found = differences(series_a, series_b)
    side_by_side = [
        ComparedFigure(name, unit, of_a, of_b)
        for (name, unit, of_a), (_, _, of_b) in zip(figures(left), figures(right), strict=True)
    ]
    if json:
        whole = {
            "same": found.none,
            "zero": "arming" if zeros(series_a, series_b)[0] == series_a.armed_ns else "beginning",
            "damage": damage,
            "figures": msgspec.to_builtins(side_by_side),
            **msgspec.to_builtins(found),
        }
        print(msgspec.json.format(msgspec.json.encode(whole)).decode())
    else:
        print(harmless(as_text(found, side_by_side)))
        print(harmless("".join(f"{said}\n" for said in damage)), end="")
    if damage:
        return LOST
    return DONE if found.none else ERROR


def figures(recording: Recording) -> list[tuple[str, str, float | None]]:
    """Name, unit, value."""
    dive = read_dive(recording)
    report = report_on(dive, Extras())
    stick = report.latency_ms.stick_to_thruster
    of_depth = [stop for stop in report.stops if stop.axis == "heave"]
    stops = [stop.overshoot for stop in of_depth if not stop.by]  # by the truth alone
    lost = sum(count for name, count in report.losses.items() if is_loss(name))
    return [
        ("length", "s", report.seconds),
        ("armed", "s", report.armed_seconds),
        ("deepest", "m", dive.max_depth_m),
        ("depth error, rms", "m", report.depth_error_rms_m),
        ("heading error, rms", "°", report.heading_error_rms_deg),
        ("worst depth stop", "m", max(stops, default=None)),
        ("jerk over its limit, peak", "-", report.peak_jerk_ratio),
        ("stick to thruster, median", "ms", stick.p50),
        ("stick to thruster, 99 %", "ms", stick.p99),
        ("energy", "Wh", report.energy.wh),
        ("thrust squared", "N² s", report.energy.thrust_squared_n2s),
        ("failsafes", "", float(len(report.failsafes))),
        ("losses of all kinds", "", float(lost)),
    ]


def as_text(found: Differences, side_by_side: Sequence[ComparedFigure]) -> str:
    """Figures, topics with other numbers of messages, then the fields that differ."""
    rows = [
        [each.name, each.unit, _number(each.a), _number(each.b), _number(_apart(each))]
        for each in side_by_side
    ]
    blocks = ["\n".join(aligned([["", "", "A", "B", "B - A"], *rows], left=2))]
    if found.none:
        same = "all fields of all messages are the same; their stamps and numbers are not compared"
        return f"{blocks[0]}\n\n{same}"
    if found.counts:
        counts = [[each.topic, str(each.a), str(each.b)] for each in found.counts]
        blocks.append("\n".join(aligned([["messages of", "A", "B"], *counts])))
    if found.fields:
        heads = ["topic", "field", "first [s]", "A", "B", "largest", "at [s]"]
        lines = aligned([heads, *map(_row, found.fields[:SHOWN])], left=2)
        if (more := len(found.fields) - SHOWN) > 0:
            lines.append(f"and {more} more fields; --json has all")
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


def _row(field: FieldDifference) -> list[str]:
    values = [value if isinstance(value, str) else _number(value) for value in (field.a, field.b)]
    numbers = _number(field.largest), _number(field.largest_s)
    return [field.topic, field.field, f"{field.first_s:.3f}", *(v[:24] for v in values), *numbers]


def _apart(of: ComparedFigure) -> float | None:
    """Without what rounding makes of sums."""
    if of.a is None or of.b is None:
        return None
    return 0.0 if abs(of.b - of.a) <= ROUNDED * max(abs(of.a), abs(of.b)) else of.b - of.a


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


class Words:
    """Every word has a number: the same word the same in both recordings. None is NaN."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def number(self, value: Any) -> float:
        if value is None:
            return nan
        if isinstance(value, str):
            value = value if len(value) <= LONGEST else sha256(value.encode()).hexdigest()
            return float(self._numbers.setdefault(value, len(self._numbers)))
        return float(value)

    def word(self, number: float) -> str:
        return [*self._numbers][int(number)]


class TopicSeries:
    """What one topic says over time: the columns that can be compared."""

    def __init__(self, columns: Sequence[TableColumn]) -> None:
        self.log_ns = array("q")  # [ns] UTC of arrival
        self._places = [n for n, column in enumerate(columns) if _is_compared(column.name)]
        self.kinds: dict[str, Kind] = {columns[n].name: columns[n].kind for n in self._places}
        self._numbers = array("d")

    def add(self, row: Row, log_ns: int, words: Words) -> None:
        """
        Raises:
            OverflowError, TypeError: it is no number that a message of ours has.
        """
        self._numbers.extend([words.number(row[place]) for place in self._places])
        self.log_ns.append(log_ns)

    def times(self, origin_ns: int) -> Array:
        """[s] since the origin."""
        return (np.asarray(self.log_ns) - origin_ns) / 1e9

    def __getitem__(self, name: str) -> Array:
        numbers = np.asarray(self._numbers).reshape(-1, len(self.kinds))
        return numbers[:, [*self.kinds].index(name)]


class DiveSeries:
    """All topics of a recording.

    Attributes:
        armed_ns: [ns] UTC of the first status that says so; None: never.
        unread: messages that are not JSON, or do not fit their topic.
    """

    def __init__(self, recording: Recording, words: Words) -> None:
        self.topics: dict[str, TopicSeries] = {}
        self.words = words
        rows = FlattenedRows(recording)
        self.unread = 0
        for key, columns, message, row in rows:
            if (series := self.topics.get(key)) is None:
                series = self.topics[key] = TopicSeries(columns)
            try:
                series.add(row, message.log_ns, words)
            except (TypeError, ValueError, OverflowError):
                self.unread += 1
        self.unread += rows.unread.total()
        self.recording_ns = recording.origin_ns() or 0  # [ns] UTC
        self.armed_ns: int | None = None
        status = self.topics.get(topics.STATUS.key)
        if status is not None and "armed" in status.kinds:
            armed = np.flatnonzero(status["armed"] > 0.0)
            self.armed_ns = status.log_ns[int(armed[0])] if len(armed) else None


def _is_compared(name: str) -> bool:
    field = name.rpartition(".")[2]
    return field not in IDENTIFIERS and not field.endswith("_ns")


def zeros(a: DiveSeries, b: DiveSeries) -> tuple[int, int]:
    """[ns] UTC in each from which seconds count: arming, if both were armed, else the beginning."""
    if a.armed_ns is not None and b.armed_ns is not None:
        return a.armed_ns, b.armed_ns
    return a.recording_ns, b.recording_ns


def differences(a: DiveSeries, b: DiveSeries) -> Differences:
    counts: list[Counted] = []
    fields: list[FieldDifference] = []
    for key in sorted({*a.topics, *b.topics}):
        left, right = a.topics.get(key), b.topics.get(key)
        size = [0 if series is None else len(series.log_ns) for series in (left, right)]
        if size[0] != size[1]:
            counts.append(Counted(key, size[0], size[1]))
        if left is not None and right is not None:
            fields += topic_differences(key, (left, right), zeros(a, b), a.words)
    return Differences(counts, sorted(fields, key=lambda field: (field.first_s, field.topic)))


def topic_differences(
    key: str, both: tuple[TopicSeries, TopicSeries], zero_ns: tuple[int, int], words: Words
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
        size = 0.0 if same_times else float(np.max(np.abs(np.nan_to_num([left, right]))))
        within = ROUNDED * size if kind == "number" else 0.0
        differs: NDArray[np.bool_] = (np.isnan(left) != np.isnan(right)) | (by > within)
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
