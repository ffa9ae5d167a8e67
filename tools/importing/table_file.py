"""Tables (.csv, .parquet), by the library pyarrow. A table is one source, by its file's name."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from services.runtime.config.errors import LindyError
from tools.importing.log_file import (
    LONGEST_MAGIC,
    PARQUET,
    LogFile,
    LogRow,
    LogSource,
    Wanted,
    cell,
    column_rows,
    library,
    listed,
    other_kind,
)
from tools.importing.map_file import STAMP_UNITS, TakenMessage

BLANK = ["", "--.--", "-.-", "--", "null", "NULL", "None", "NA", "N/A"]  # no sample; NaN is odd
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
        if not path.stat().st_size:
            raise LindyError(f"{path} is empty")
        is_parquet = path.suffix.lower() == ".parquet"
        if is_parquet:
            self.refuse_other(PARQUET, "a Parquet table")
        else:
            with path.open("rb") as file:
                if found := other_kind(file.read(LONGEST_MAGIC)):
                    raise LindyError(f"{path} is no table: {found}")
        pa, csv = library("pyarrow", "tables"), library("pyarrow.csv", "tables")
        try:
            if is_parquet:
                self._table = library("pyarrow.parquet", "tables").read_table(path)
            else:
                blank = csv.ConvertOptions(null_values=BLANK, strings_can_be_null=True)
                self._table = csv.read_csv(path, convert_options=blank)
            self._names: list[str] = self._table.column_names  # of text that is none: ValueError
        except (pa.ArrowException, OSError, ValueError) as error:
            # Behind a second colon are the bytes that it could not read.
            why = ":".join(str(error).partition("\n")[0].split(":")[:2]).rstrip(".")
            raise LindyError(f"{path} is damaged or no table: {why}") from None
        if not self._table.num_rows:
            raise LindyError(f"{path} has no rows below its names of columns")

    def sources(self) -> dict[str, LogSource]:
        columns = frozenset(self._names)
        return {self.path.stem: LogSource("table", self._table.num_rows, columns)}

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        for source, several in wanted.items():
            at_ns, whole = self._times(several)
            table = self._table
            if not np.all(whole):
                table, at_ns = table.filter(whole), at_ns[whole]
                lost = np.count_nonzero(~whole)
                self.remarks.append(f"{lost} rows of {self.path.name} have no time")
            back = np.flatnonzero(np.diff(at_ns) < -BACK_NS)
            if len(back) > max(MOST_BACK, len(at_ns) // 100):
                raise LindyError(
                    f"{self.path}: its rows are not in the order of their times ({len(back)} are "
                    f"before the one above, the first is at about line {back[0] + 3}); sort it by "
                    f"time"
                )
            columns = {name: table[name].combine_chunks() for name in self._names}
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
        column: Any = self._table[taken.stamp]
        kind = str(column.type)
        is_date = kind.startswith("timestamp")
        if is_date != (taken.stamp_unit == "date"):
            what = 'dates; write stamp_unit = "date"' if is_date else "no dates; write its unit"
            raise LindyError(f"{self.path}: {taken.stamp} has {what} at {taken.where} in the map")
        whole = np.asarray(column.is_valid())
        if is_date:
            if column.type.tz is None:
                self.remarks.append(f"the times of {self.path.name} have no zone: taken as UTC")
            return np.asarray(column.cast("timestamp[ns]").cast("int64").fill_null(0)), whole
        if not kind.startswith(NUMBERS) or taken.stamp_unit == "ros":
            raise LindyError(
                f"{self.path}: {taken.stamp} is {column[0]} with the stamp_unit "
                f"{taken.stamp_unit!r}; write at {taken.where} in the map ns, us, ms, s, or date "
                f"for times as 2024-05-01T09:30:00.123"
            )
        scale, values = STAMP_UNITS[taken.stamp_unit], np.asarray(column.fill_null(0))
        if values.dtype.kind in "iu":
            return values.astype(np.int64) * scale, whole
        return np.round(np.nan_to_num(values) * scale).astype(np.int64), whole
