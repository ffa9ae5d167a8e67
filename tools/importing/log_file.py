"""What a reader of a format gives of a log: rows, and which kinds of them there are."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from messages.units import Ns
from services.runtime.config.errors import LindyError
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

Wanted = Mapping[str, Sequence[TakenMessage]]  # what a map takes, by source

BY_FILE = (
    "without a GPS its clock only counts from the board's start: its end is taken from the time at "
    "which the file was changed last; began in a map says it better"
)


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


class LogFile(Protocol):
    """One log. Its rows can be read more than once, each time from the beginning."""

    default_map: str  # name in deploy/imports
    getter: Callable[[str], Callable[[Any], Any]]  # takes a field of this name out of a row's

    @property
    def remarks(self) -> list[str]:
        """What a reader of the recording should know, one sentence each."""
        ...

    def sources(self) -> dict[str, LogSource]:
        """By name.

        Raises:
            LindyError: the log cannot be used.
        """
        ...

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        """Of these sources, in the order of the log.

        Raises:
            LindyError: the log is damaged.
        """
        ...


def refuse_other(path: Path, magic: bytes, kind: str) -> None:
    """
    Raises:
        LindyError: the file does not begin as those of this kind do.
    """
    with path.open("rb") as file:
        beginning = file.read(LONGEST_MAGIC)
    if not beginning:
        raise LindyError(f"{path} is not {kind}: it is empty")
    if not beginning.startswith(magic):
        found = other_kind(beginning) or f"it begins with {beginning[: len(magic)]!r}"
        raise LindyError(f"{path} is not {kind}: {found}")


def other_kind(beginning: bytes) -> str:
    """What a file is that begins so, where its name says something else; empty: not known."""
    for magic, (kind, ending) in KINDS.items():
        if beginning.startswith(magic):
            return f"it begins as {kind} does; if it is one, name it so ({ending})"
    return ""


def began_by_file(path: Path, last_ns: Ns) -> tuple[Ns, str]:
    """[ns] UTC when a board's clock began, of which the log only knows how long it ran until its
    end; and a remark on that. An end before 1970 is of a damaged log."""
    return max(0, path.stat().st_mtime_ns - last_ns), BY_FILE


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
