"""One dive from several files of one format and one clock: one of each sensor, or one log in
pieces."""

from collections.abc import Iterator
from datetime import UTC, datetime
from heapq import merge
from itertools import chain, combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from messages.units import Ns
from services.runtime.config.errors import LindyError
from tools.importing.log_file import LogFile, LogRow, LogSource, Wanted, listed
from tools.importing.streams import LONGEST_PAUSE_NS

BORDER_NS = 1_000_000_000  # [ns] by which two pieces of one log may overlap


class FileSpan(NamedTuple):
    """What is taken of a file, and from when until when."""

    name: str
    sources: set[str]
    first: Ns
    last: Ns

    def overlaps(self, other: "FileSpan") -> Ns:
        """[ns] negative: the pause between them."""
        return min(self.last, other.last) - max(self.first, other.first)

    @property
    def in_words(self) -> str:
        begin, end = (datetime.fromtimestamp(at / 1e9, UTC) for at in (self.first, self.last))
        return f"{self.name} is from {begin:%Y-%m-%d %H:%M:%S} to {end:%Y-%m-%d %H:%M:%S}"


class SeveralFiles(LogFile):
    """Their rows in the order of their times."""

    def __init__(self, logs: list[LogFile]) -> None:
        """
        Raises:
            LindyError: they are of different formats.
        """
        super().__init__(Path(", ".join(str(log.path) for log in logs)))
        self.default_map, self.getter = logs[0].default_map, logs[0].getter
        for log in logs:
            if type(log) is not type(logs[0]):
                raise LindyError(
                    f"{logs[0].path} and {log.path} are of two formats, each with clocks of its "
                    f"own: import each by itself"
                )
        self._logs = logs
        self._sources: list[dict[str, LogSource]] = []  # of each

    @property
    def remarks(self) -> list[str]:
        return [*dict.fromkeys(chain(super().remarks, *(log.remarks for log in self._logs)))]

    @property
    def changed_ns(self) -> Ns:
        return max(log.changed_ns for log in self._logs)

    def sources(self) -> dict[str, LogSource]:
        self._sources = [log.sources() for log in self._logs]
        found: dict[str, LogSource] = {}
        for log, sources in zip(self._logs, self._sources, strict=True):
            for name, source in sources.items():
                before = found.get(name, LogSource(source.kind, 0))
                if before.kind != source.kind:
                    raise LindyError(
                        f"{log.path}: {name} is {source.kind}, and {before.kind} in another file"
                    )
                count = source.messages + before.messages
                found[name] = LogSource(source.kind, count, source.columns)
        return found

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        each: list[Wanted] = [
            {name: taken for name, taken in wanted.items() if name in sources}
            for sources in self._sources
        ]
        self._require_one_clock(each)
        rows = [log.rows(part) for log, part in zip(self._logs, each, strict=True)]
        yield from merge(*rows, key=lambda row: row.arrival_ns)

    def _require_one_clock(self, wanted: list[Wanted]) -> None:
        """
        Args:
            wanted: of each file.

        Raises:
            LindyError: a file has nothing to do with the others, or two are of two boards.
        """
        if left := [
            log.path.name for log, part in zip(self._logs, wanted, strict=True) if not part
        ]:
            self.say(f"left out, because the map takes nothing of it: {listed(left)}")
        spans: list[FileSpan] = []
        for log, part, sources in zip(self._logs, wanted, self._sources, strict=True):
            if not part:
                continue
            times = np.array([row.arrival_ns for row in log.rows(part)], np.int64)
            if not len(times):
                columns = [name for source in sources.values() for name in sorted(source.columns)]
                has = listed([*sources] if len(sources) > 1 else columns or [*sources])
                raise LindyError(f"{log.path}: nothing in it is in this map; it has {has}")
            spans.append(FileSpan(log.path.name, {*part}, int(times.min()), int(times.max())))
        for one, other in combinations(spans, 2):
            both = one.sources & other.sources
            if both and one.overlaps(other) > BORDER_NS:
                raise LindyError(
                    f"{one.name} and {other.name} both have {min(both)} at the same time: they are "
                    f"of two boards, or the same; one recording is of one vehicle"
                )
        for one in spans:
            others = [each for each in spans if each is not one]
            if others and not any(
                one.overlaps(each) >= (-LONGEST_PAUSE_NS if one.sources & each.sources else 0)
                for each in others
            ):
                raise LindyError(
                    f"{one.in_words}, and {others[0].in_words}: that is not one dive, or they "
                    f"are by two clocks"
                )
