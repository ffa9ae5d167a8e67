"""What a format's reader gives of a log, rows and kinds of them; and which of these a map takes."""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.units import Ns
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.importing.map_file import TARGETS, ImportMap, TakenMessage

EMPTY = b"\0\xff"  # of a file that was made longer, and of flash memory
SUBMARINE = 12  # MAV_TYPE
CHUNK = 10_000  # rows of columns that are Python's numbers at a time
EARLIEST_NS = (
    978_307_200 * 10**9
)  # [ns] UTC, the year 2001; a clock that was never set may begin in 2000
LATEST_NS = 4_102_444_800 * 10**9  # [ns] UTC, the year 2100; a later one is damaged
BY_FILE = (
    "its clock was never set: without a GPS or a network it only counts from a start; its end is "
    "taken from the time at which the file was changed last; began in a map says it better"
)

Wanted = Mapping[str, Sequence[TakenMessage]]  # what a map takes, by source


class BlankError(Exception):
    """A row of a table has nothing in a column: it is of another sensor."""


class LogRow(NamedTuple):
    """One message of a log, as its format's library decodes it."""

    source: str  # topic of a bag, name of a message elsewhere
    fields: Any  # fields are attributes, of which some may have attributes or items
    arrival_ns: Ns  # [ns] UTC when the logger wrote it


class LogSource(NamedTuple):
    """One topic of a bag, or one kind of message elsewhere."""

    kind: str  # type of its messages; that of a log without types is its name
    messages: int
    columns: frozenset[str] = frozenset()  # of a log that has them


def getter(path: str) -> Callable[[Any], Any]:
    """What takes `data.4`, `header.stamp` or `GyrX` out of a row's fields. It raises
    AttributeError, IndexError or TypeError where there is nothing of that name."""
    parts = path.split(".")
    if not any(part.isdecimal() for part in parts):
        return attrgetter(path)

    def taken(fields: Any) -> Any:
        for part in parts:
            fields = fields[int(part)] if part.isdecimal() else getattr(fields, part)
        return fields

    return taken


def cell(name: str) -> Callable[[Any], Any]:
    """The same of a log with columns, whose names may hold dots and brackets. It raises BlankError
    where nothing is in the cell."""

    def taken(fields: Any) -> Any:
        found = fields.get(name)
        if found is None:
            raise BlankError(name)
        return found

    return taken


class LogFile(ABC):
    """One log. Its rows can be read more than once, each time from the beginning."""

    default_map: str  # name in deploy/imports
    getter: Callable[[str], Callable[[Any], Any]] = staticmethod(getter)

    def __init__(self, path: Path) -> None:
        """
        Raises:
            LindyError: a library is not installed, or it is no such log.
        """
        self.path = path
        self.damaged = Counter[str]()  # messages that cannot be read and are left out, by source
        self._remarks: dict[str, None] = {}

    def say(self, remark: str) -> None:
        """What a reader of the recording should know, one sentence; it counts once."""
        self._remarks[remark] = None

    @property
    def remarks(self) -> list[str]:
        """All that was said, and what is damaged."""
        each = [f"{count} of {source}" for source, count in sorted(self.damaged.items()) if count]
        damage = [f"damaged messages are left out: {listed(each)}"] if each else []
        return [*self._remarks, *damage]

    @property
    def changed_ns(self) -> Ns:
        """[ns] UTC when it was written last."""
        return self.path.stat().st_mtime_ns

    @abstractmethod
    def sources(self) -> dict[str, LogSource]:
        """By name.

        Raises:
            LindyError: the log cannot be used.
        """

    @abstractmethod
    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        """Of these sources, in the order of the log.

        Raises:
            LindyError: the log is damaged.
        """

    def require_submarine(self, kind: int) -> None:
        """
        Args:
            kind: MAV_TYPE of the vehicle.

        Raises:
            LindyError: it is none.
        """
        if kind != SUBMARINE:
            raise LindyError(
                f"{self.path} is of a vehicle of MAVLink's type {kind}; expected {SUBMARINE}, a "
                f"submarine: another vehicle's axes and modes are not those of the map"
            )

    def utc_of_start(self, said_ns: Iterable[Ns], last_ns: Ns) -> Ns:
        """[ns] UTC when a board's clock began.

        Args:
            said_ns: as its GPS says; what cannot be is passed over.
            last_ns: how long it ran until the end of its log.
        """
        for utc_ns in said_ns:
            if EARLIEST_NS <= utc_ns < LATEST_NS:
                return utc_ns
        self.say(BY_FILE)
        return max(EARLIEST_NS, self.changed_ns - last_ns)


def library(module: str, what: str) -> Any:
    """
    Raises:
        LindyError: what needs it cannot be read, because it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError:
        package = module.partition(".")[0]
        raise LindyError(
            f"{what} need {package}, which is missing: {how_to_install('import')}"
        ) from None


def column_rows(
    source: str, columns: Mapping[str, Any], at_ns: NDArray[np.int64], wanted: Wanted
) -> Iterator[LogRow]:
    """
    Args:
        columns: arrays (n,) of NumPy or of Arrow, by name.
        at_ns: (n,) [ns] UTC of each row.
        wanted: only the columns that are named there are taken.
    """
    names = [name for name in columns if any(name in each.names for each in wanted[source])]
    for begin in range(0, len(at_ns), CHUNK):
        part = slice(begin, begin + CHUNK)
        cells = zip(*(columns[name][part].tolist() for name in names), strict=True)
        for at, row in zip(at_ns[part].tolist(), cells, strict=True):
            yield LogRow(source, dict(zip(names, row, strict=True)), at)


SHOWN = 12  # sources of a log that a sentence lists


def chosen(
    import_map: ImportMap, sources: Mapping[str, LogSource], name: str
) -> dict[str, list[TakenMessage]]:
    """What is taken of each source that is needed. Of two parts of the map that give the same
    field of ours, the first counts that the log has.

    Args:
        name: of the log, for the error.

    Raises:
        LindyError: the log has nothing that the map knows, or two sources that fit one part.
    """
    found: dict[str, list[TakenMessage]] = {}
    given: set[tuple[str, str]] = set()  # key and field that have a source
    for taken in import_map.take:
        if given & {(taken.as_, field) for field in taken.fields}:
            continue
        fitting = [
            source
            for source, kind in sources.items()
            if kind.messages and _is_meant(taken, source, kind) and not _lacks(taken, kind)
        ]
        if len(fitting) > 1:
            raise LindyError(
                f"{name}: {' and '.join(fitting)} are both {taken.type}, and only one can be "
                f'{taken.as_}; write topic = "{fitting[0]}" in its place in a copy of the map'
            )
        for source in fitting:
            found.setdefault(source, []).append(taken)
            given |= {(taken.as_, field) for field in taken.fields}
    if not found:
        if lacking := unfit(import_map, sources, ()):
            raise LindyError(f"{name}: {lacking[0]}; write there the columns that it has")
        if not any(kind.messages for kind in sources.values()):
            raise LindyError(f"{name} holds no whole message")
        named = listed([f"{source} ({kind.kind})" for source, kind in sources.items()])
        takes = listed([*dict.fromkeys(each.topic or each.type for each in import_map.take)])
        raise LindyError(
            f"{name}: nothing in it is in this map, which takes {takes}; it has {named}; "
            f"write a map that says which of these is which sensor"
        )
    return found


def missing(taken: Mapping[str, Sequence[TakenMessage]]) -> list[str]:
    """Keys of ours that could be imported and that the log does not give."""
    given = {each.as_ for several in taken.values() for each in several}
    return [key for key in TARGETS if key not in given]


def unfit(
    import_map: ImportMap, sources: Mapping[str, LogSource], given: Sequence[str]
) -> list[str]:
    """Parts of the map that mean a source of the log which lacks their columns, in words.

    Args:
        given: keys of ours that have a source.
    """
    return [
        f"{source} has no {listed(sorted(lacking))}, which the map names at {taken.where}; "
        f"it has {listed(sorted(kind.columns))}"
        for taken in import_map.take
        for source, kind in sources.items()
        if taken.as_ not in given
        and _is_meant(taken, source, kind)
        and (lacking := _lacks(taken, kind))
    ]


def untaken(
    taken: Mapping[str, Sequence[TakenMessage]], sources: Mapping[str, LogSource]
) -> list[str]:
    """Sources that have messages and are not taken, with their types, and columns that are not of
    those that are. First those that are called as a missing key."""
    found: list[str] = []
    for source, kind in sources.items():
        if source in taken and kind.columns:
            named = set[str]().union(*(each.names for each in taken[source]))
            found += [f"{name} in {source}" for name in sorted(kind.columns - named)]
        elif source not in taken and kind.messages:
            found.append(source if kind.kind == source else f"{source} ({kind.kind})")
    words = {key.rpartition("/")[2] for key in missing(taken)}
    return sorted(found, key=lambda name: not any(word in name.lower() for word in words))


def listed(names: Sequence[str], shown: int = SHOWN) -> str:
    """Those that a sentence has room for."""
    more = f" and {len(names) - shown} more" if len(names) > shown else ""
    return ", ".join(names[:shown]) + more


def _is_meant(taken: TakenMessage, source: str, kind: LogSource) -> bool:
    if taken.topic:
        pattern = taken.topic.strip("/").replace("[", "[[]")
        return fnmatchcase(source.strip("/"), pattern) and taken.type in ("", kind.kind)
    return kind.kind == taken.type


def _lacks(taken: TakenMessage, kind: LogSource) -> set[str]:
    """Columns without which it is not this message; empty: it has them, or a log without columns
    shows it only by its rows."""
    if not kind.columns:
        return set()
    known = TARGETS[taken.as_]
    fields = [{*field.from_} for name, field in taken.fields.items() if known[name].required]
    if not fields and not any(kind.columns.issuperset(f.from_) for f in taken.fields.values()):
        fields = [{*field.from_} for field in taken.fields.values()]
    return {*taken.only}.union(*fields) - kind.columns
