"""Logs with columns: of PX4 (.ulg), by the library pyulog, and tables (.csv, .parquet), by the
library pyarrow. A table is one source, by its file's name."""

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from heapq import merge
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from messages.units import Ns
from services.runtime.config.errors import LindyError
from tools.importing.log_file import (
    EARLIEST_NS,
    EMPTY,
    LATEST_NS,
    LogFile,
    LogRow,
    LogSource,
    Wanted,
    cell,
    column_rows,
    library,
    listed,
)
from tools.importing.map_file import STAMP_UNITS, TakenMessage, remedy
from tools.importing.table_text import TableText

PAGE = 4096  # [B] a last message may end with less than this of zeros
MOST_AGAIN = 100_000  # reads of what was read; it looks for the next message byte by byte


class ForwardFile(io.BytesIO):
    """Where the end of a log is damaged, pyulog reads the same bytes for ever."""

    def __init__(self, content: bytes) -> None:
        super().__init__(content)
        self._farthest = self._again = 0

    def read(self, size: int | None = -1, /) -> bytes:
        """
        Raises:
            EOFError: it gets no further.
        """
        found = super().read(size)
        self._again += 1
        if (at := self.tell()) > self._farthest:
            self._farthest, self._again = at, 0
        elif self._again > MOST_AGAIN:
            raise EOFError("it cannot be read to its end")
        return found


class UlogFile(LogFile):
    """One log. A topic of one of several sensors is called as `sensor_baro[1]`, but for the first;
    columns are called as pyulog does, such as `gyro_rad[0]`."""

    default_map = "px4"
    getter = staticmethod(cell)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        data = path.read_bytes()  # pyulog keeps all of it in memory as well
        content = data.rstrip(EMPTY)
        if (space := len(data) - len(content)) > PAGE:
            self.say(f"{space} bytes of empty space behind its end are left out")
        else:
            content = data
        pyulog = library("pyulog", "logs of PX4")
        try:
            with ForwardFile(content) as file, redirect_stdout(io.StringIO()):  # it prints
                self._log: Any = pyulog.ULog(file)
        except Exception as error:  # of whatever kind: where bytes are wrong, pyulog does not say
            raise LindyError(f"{path} is damaged: {error or 'a message cannot be read'}") from None
        self._topics: dict[str, Mapping[str, Any]] = {
            each.name + (f"[{each.multi_id}]" if each.multi_id else ""): each.data
            for each in self._log.data_list
            if "timestamp" in each.data  # all have it, but in a damaged log
        }
        if self._log.file_corruption:
            self.say("a part of it is damaged, and left out")
        if lost := sum(each.duration for each in self._log.dropouts):
            drops = len(self._log.dropouts)
            often = "once" if drops == 1 else f"{drops} times"
            self.say(f"its logger was too slow {often}, and lost {lost / 1e3:.2f} s")
        kinds = self._topics.get("vehicle_status", {}).get("system_type", np.zeros(0))
        kind = kinds[-1] if len(kinds) else self._log.initial_parameters.get("MAV_TYPE")
        if kind is not None:
            self.require_submarine(int(kind))
        last_ns = int(self._log.last_timestamp) * 1000
        self._utc_ns = self.utc_of_start(self._said_by_gps(), last_ns)

    def sources(self) -> dict[str, LogSource]:
        return {
            name: LogSource(name, len(columns["timestamp"]), frozenset(columns))
            for name, columns in self._topics.items()
        }

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        topics: list[Iterator[LogRow]] = []
        for name in wanted:
            columns = self._topics[name]
            at_ns = columns["timestamp"].astype(np.int64) * 1000 + self._utc_ns
            topics.append(column_rows(name, columns, at_ns, wanted))
        yield from merge(*topics, key=lambda row: row.arrival_ns)

    def _said_by_gps(self) -> Iterator[Ns]:
        """[ns] UTC when the board's clock began."""
        for name in ("vehicle_gps_position", "sensor_gps"):
            columns = self._topics.get(name, {})
            utc = columns.get("time_utc_usec", np.zeros(0))
            for k in np.flatnonzero(utc).tolist():
                yield (int(utc[k]) - int(columns["timestamp"][k])) * 1000


PARQUET = b"PAR1"  # how it begins
NUMBERED = ("ns", "us", "ms", "s")  # units of a time that is a number
NUMBERS = ("int", "uint", "float", "double", "halffloat")  # types as pyarrow calls them
BACK_NS = 1_000_000_000  # [ns] a row further back than this is not by the jitter of its logger
MOST_BACK = 5  # rows: a clock that was set, or a logger that was started again

Stamps = NDArray[np.int64]  # [ns] UTC


class TableFile(LogFile):
    """One table, of which the map names the column with the time."""

    default_map = "tables"
    getter = staticmethod(cell)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            is_parquet = file.read(len(PARQUET)) == PARQUET
        if is_parquet:
            pa, parquet = library("pyarrow", "tables"), library("pyarrow.parquet", "tables")
            try:
                self._table = parquet.read_table(path)
            except (pa.ArrowException, OSError) as error:
                # Behind a second colon are the bytes that it could not read.
                why = ":".join(str(error).partition("\n")[0].split(":")[:2]).rstrip(".")
                raise LindyError(f"{path} is damaged or no table: {why}") from None
            self._column: Callable[[str], Any] = self._table.__getitem__
        else:
            text = TableText(path, self.say)
            self._table, self._column = text.words, text.column
        if not self._table.num_rows:
            raise LindyError(f"{path} has no rows below its names of columns")
        self._names: list[str] = self._table.column_names

    def sources(self) -> dict[str, LogSource]:
        columns = frozenset(self._names)
        return {self.path.stem: LogSource("table", self._table.num_rows, columns)}

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        for source, several in wanted.items():
            at_ns, whole = self._times(several)
            named = set[str]().union(*(each.names for each in several)) & {*self._names}
            columns: dict[str, Any] = {name: self._column(name) for name in named}
            if not np.all(whole):
                lost = np.count_nonzero(~whole)
                has, is_ = (
                    ("row", "has no time and is") if lost == 1 else ("rows", "have no time and are")
                )
                self.say(f"{lost} {has} of {self.path.name} {is_} left out")
                columns = {name: column.filter(whole) for name, column in columns.items()}
                at_ns = at_ns[whole]
            back = np.flatnonzero(np.diff(at_ns) < -BACK_NS)
            if len(back) > max(MOST_BACK, len(at_ns) // 100):
                raise LindyError(
                    f"{self.path}: its rows are not in the order of their times ({len(back)} are "
                    f"before the one above, the first is at about line {back[0] + 3}); sort it by "
                    f"time"
                )
            columns = {name: column.combine_chunks() for name, column in columns.items()}
            columns |= {taken.stamp: at_ns for taken in several if taken.stamp_unit == "date"}
            yield from column_rows(source, columns, at_ns, wanted)

    def _times(self, several: Sequence[TakenMessage]) -> tuple[Stamps, NDArray[np.bool_]]:
        """(rows,) [ns] UTC, and where there is one.

        Raises:
            LindyError: the map does not say in which column the time is, or there is none in it.
        """
        taken = several[0]
        if len({(each.stamp, each.stamp_unit) for each in several}) > 1:
            raise LindyError(
                f"{self.path}: the map names several columns for its time; expected one of a table"
            )
        if taken.stamp not in self._names:
            raise LindyError(
                f"{self.path} has no column {taken.stamp!r} for the time; write at {taken.where} "
                f"in the map stamp = one of {listed(self._names)}"
            )
        column: Any = self._column(taken.stamp)
        kind = str(column.type)
        is_date, is_number = kind.startswith("timestamp"), kind.startswith(NUMBERS)
        if not is_date and not is_number:
            raise LindyError(
                f"{self.path}: {taken.stamp}, the time at {taken.where} in the map, is {column[0]} "
                f"in its first row, which is neither a number nor a date and time such as "
                f"2024-05-01T09:30:00.123"
            )
        if is_date != (taken.stamp_unit == "date") or taken.stamp_unit == "ros":
            units = ", ".join(f'"{unit}"' for unit in NUMBERED)
            how = '"date"' if is_date else f"one of {units}"
            what = f"{'dates' if is_date else 'no dates'}; write stamp_unit = {how}"
            raise LindyError(f"{self.path}: {taken.stamp} has {what} at {taken.where} in the map")
        whole = np.asarray(column.is_valid())
        if is_date:
            if column.type.tz is None:
                self.say(f"the times of {self.path.name} have no zone: taken as UTC")
            return np.asarray(column.cast("timestamp[ns]").cast("int64").fill_null(0)), whole
        scale, values = STAMP_UNITS[taken.stamp_unit], np.asarray(column.fill_null(0))
        middle = float(np.nanmedian(values[whole])) if np.any(whole) else 0.0
        fitting = [
            unit for unit in NUMBERED if EARLIEST_NS <= middle * STAMP_UNITS[unit] < LATEST_NS
        ]
        if (fitting and taken.stamp_unit not in fitting) or middle * scale >= LATEST_NS:
            how = remedy("stamp_unit", fitting, "another column")
            raise LindyError(
                f"{self.path}: {taken.stamp} is {middle:.10g} in the middle, which is no time "
                f"since 1970 in {taken.stamp_unit}; write {how} at {taken.where} in the map"
            )
        whole &= np.abs(values.astype(float) * scale) < LATEST_NS  # nor where it is no number
        values = np.where(whole, values, 0)
        if values.dtype.kind in "iu":
            return values.astype(np.int64) * scale, whole
        return np.round(values * scale).astype(np.int64), whole
