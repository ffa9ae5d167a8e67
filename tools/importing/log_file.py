"""What a reader of a format gives of a log: rows, and which kinds of them there are."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.units import Ns
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.importing.map_file import TakenMessage

MCAP, ROSBAG, ULOG = b"\x89MCAP0\r\n", b"#ROSBAG V2.0", b"ULog\x01\x12\x35"
DATAFLASH, PARQUET = b"\xa3\x95\x80", b"PAR1"
KINDS = {  # how a file begins: what it is, and how its name ends
    MCAP: ("an MCAP recording", ".mcap"),
    ROSBAG: ("a bag of ROS 1", ".bag"),
    ULOG: ("a log of PX4", ".ulg"),
    DATAFLASH: ("a log of ArduSub", ".bin"),
    PARQUET: ("a Parquet table", ".parquet"),
}
LONGEST_MAGIC = max(map(len, KINDS))  # [B]
SUBMARINE = 12  # MAV_TYPE
CHUNK = 10_000  # rows of columns that are Python's numbers at a time
BY_FILE = (
    "without a GPS its clock only counts from the board's start: its end is taken from the time at "
    "which the file was changed last; began in a map says it better"
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
    """One log. Its rows can be read more than once, each time from the beginning; a remark that is
    there twice counts once."""

    default_map: str  # name in deploy/imports
    getter: Callable[[str], Callable[[Any], Any]] = staticmethod(getter)

    def __init__(self, path: Path) -> None:
        """
        Raises:
            LindyError: a library is not installed, or it is no such log.
        """
        self.path = path
        self.remarks: list[
            str
        ] = []  # what a reader of the recording should know, one sentence each

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

    def refuse_other(self, magic: bytes, kind: str) -> None:
        """
        Raises:
            LindyError: the file does not begin as those of this kind do.
        """
        with self.path.open("rb") as file:
            beginning = file.read(LONGEST_MAGIC)
        if not beginning:
            raise LindyError(f"{self.path} is not {kind}: it is empty")
        if not beginning.startswith(magic):
            found = other_kind(beginning) or f"it begins with {beginning[: len(magic)]!r}"
            raise LindyError(f"{self.path} is not {kind}: {found}")

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

    def began_by_file(self, last_ns: Ns) -> Ns:
        """[ns] UTC when a board's clock began, of which the log only knows how long [ns] it ran
        until its end, which is remarked. An end before 1970 is of a damaged log."""
        self.remarks.append(BY_FILE)
        return max(0, self.path.stat().st_mtime_ns - last_ns)


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


def other_kind(beginning: bytes) -> str:
    """What a file is that begins so, where its name says something else; empty: not known."""
    for magic, (kind, ending) in KINDS.items():
        if beginning.startswith(magic):
            return f"it begins as {kind} does; if it is one, name it so ({ending})"
    return ""


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
