"""One dive from several files of one format and one clock: one of each sensor, or one log in
pieces."""

from array import array
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from heapq import merge
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

from messages.units import Ns
from services.runtime.config.errors import LindyError
from tools.importing.choosing import listed
from tools.importing.conversion import LONGEST_PAUSE_NS
from tools.importing.log_file import LogFile, LogRow, LogSource, Wanted

BORDER_NS = 1_000_000_000  # [ns] by which two pieces of one log may overlap


class _File(NamedTuple):
    path: Path
    log: LogFile
    sources: dict[str, LogSource]


class _Span(NamedTuple):
    """What is taken of a file, and from when until when."""

    name: str
    sources: set[str]
    first: Ns
    last: Ns

    def overlaps(self, other: "_Span") -> Ns:
        """[ns] negative: the pause between them."""
        return min(self.last, other.last) - max(self.first, other.first)

    @property
    def in_words(self) -> str:
        begin, end = (datetime.fromtimestamp(at / 1e9, UTC) for at in (self.first, self.last))
        return f"{self.name} is from {begin:%Y-%m-%d %H:%M:%S} to {end:%Y-%m-%d %H:%M:%S}"


class SeveralFiles:
    """Their rows in the order of their times."""

    def __init__(self, files: dict[Path, LogFile]) -> None:
        """
        Raises:
            LindyError: they are of different formats.
        """
        logs = [*files.values()]
        self.default_map = logs[0].default_map
        self.getter: Callable[[str], Callable[[Any], Any]] = logs[0].getter
        for path, log in files.items():
            if type(log) is not type(logs[0]):
                raise LindyError(
                    f"{next(iter(files))} and {path} are of two formats, each with clocks of its "
                    f"own: import each by itself"
                )
        self._files = [_File(path, log, {}) for path, log in files.items()]
        self._checked = False

    @property
    def remarks(self) -> list[str]:
        return [remark for file in self._files for remark in file.log.remarks]

    def sources(self) -> dict[str, LogSource]:
        found: dict[str, LogSource] = {}
        for file in self._files:
            file.sources.update(file.log.sources())
            for name, source in file.sources.items():
                before = found.get(name)
                if before is not None and before.kind != source.kind:
                    raise LindyError(
                        f"{file.path}: {name} is {source.kind}, and {before.kind} in another file"
                    )
                count = source.messages + (before.messages if before else 0)
                found[name] = LogSource(source.kind, count, source.columns)
        return found

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        if not self._checked:
            self._require_one_clock(wanted)
            self._checked = True
        rows = [file.log.rows(_of(file, wanted)) for file in self._files]
        yield from merge(*rows, key=lambda row: row.arrival_ns)

    def _require_one_clock(self, wanted: Wanted) -> None:
        """
        Raises:
            LindyError: a file has nothing to do with the others, or two are of two boards.
        """
        spans: list[_Span] = []
        for file in self._files:
            times = array("q", (row.arrival_ns for row in file.log.rows(_of(file, wanted))))
            if not times:
                has = [*file.sources] if len(file.sources) > 1 else []
                has = has or [
                    name for each in file.sources.values() for name in sorted(each.columns)
                ]
                raise LindyError(f"{file.path}: nothing in it is in this map; it has {listed(has)}")
            spans.append(_Span(file.path.name, {*_of(file, wanted)}, min(times), max(times)))
        for one, other in combinations(spans, 2):
            both = one.sources & other.sources
            if both and one.overlaps(other) > BORDER_NS:
                raise LindyError(
                    f"{one.name} and {other.name} both have {min(both)} at the same time: they are "
                    f"of two boards, or the same; one recording is of one vehicle"
                )
        for one in spans:
            others = [each for each in spans if each is not one]
            if not any(
                one.overlaps(each) >= (-LONGEST_PAUSE_NS if one.sources & each.sources else 0)
                for each in others
            ):
                raise LindyError(
                    f"{one.in_words}, and {others[0].in_words}: that is not one dive, or they "
                    f"are by two clocks"
                )


def _of(file: _File, wanted: Wanted) -> Wanted:
    return {name: taken for name, taken in wanted.items() if name in file.sources}
