"""Tables (.csv, .parquet), by the library pyarrow. A table is one source, by its file's name."""

from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.importing.columns import cell, column_rows, named_columns
from tools.importing.log_file import PARQUET, LogRow, LogSource, Wanted, other_kind, refuse_other
from tools.importing.map_file import STAMP_UNITS, TakenMessage

KINDS = (".csv", ".parquet")
BLANK = ["", "--.--", "-.-", "--", "null", "NULL", "None", "NA", "N/A"]  # no sample; NaN is odd
Stamps = NDArray[np.int64]  # [ns] UTC
NUMBERS = ("int", "uint", "float", "double", "halffloat")  # types as pyarrow calls them
BACK_NS = 1_000_000_000  # [ns] a row further back than this is not by the jitter of its logger
MOST_BACK = 5  # rows: a clock that was set, or a logger that was started again
SNIFFED = 4096  # [B] of a table that tell whether it is text
SHOWN = 12  # columns that a sentence lists


def is_table(path: Path) -> bool:
    return path.suffix.lower() in KINDS


class TableFile:
    """One table, of which the map names the column with the time."""

    default_map = "tables"
    getter = staticmethod(cell)

    def __init__(self, path: Path) -> None:
        """
        Raises:
            LindyError: pyarrow is not installed, or it is no table.
        """
        self.remarks: list[str] = []
        self._path = path
        if not path.stat().st_size:
            raise LindyError(f"{path} is empty")
        _refuse_other(path)
        try:
            pa: Any = import_module("pyarrow")  # without types
            csv: Any = import_module("pyarrow.csv")
        except ModuleNotFoundError:
            raise LindyError(
                f"tables need pyarrow, which is missing: {how_to_install('import')}"
            ) from None
        try:
            if path.suffix.lower() == ".parquet":
                self._table: Any = _flat_columns(pa, path)
            else:
                blank = csv.ConvertOptions(null_values=BLANK, strings_can_be_null=True)
                self._table = csv.read_csv(path, convert_options=blank)
            self._names: list[str] = self._table.column_names  # of text that is none: ValueError
        except (pa.ArrowException, OSError, ValueError) as error:
            # Behind a second colon are the bytes that it could not read.
            why = ":".join(str(error).partition("\n")[0].split(":")[:2]).rstrip(".")
            if "straddling" in why:
                why = "a row of more than 1 MB, as where a quotation mark is missing"
            raise LindyError(f"{path} is damaged or no table: {why}") from None
        if not self._table.num_rows:
            raise LindyError(f"{path} has no rows below its names of columns")

    def sources(self) -> dict[str, LogSource]:
        columns = frozenset(self._names)
        return {self._path.stem: LogSource("table", self._table.num_rows, columns)}

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        for source, several in wanted.items():
            at_ns, whole = self._times(several)
            table = self._table
            if not np.all(whole):
                table, at_ns = table.filter(whole), at_ns[whole]
                remark = f"{np.count_nonzero(~whole)} rows of {self._path.name} have no time"
                self.remarks += [] if remark in self.remarks else [remark]
            self._require_order(at_ns)
            named = named_columns(several)
            columns = {name: table[name].combine_chunks() for name in self._names if name in named}
            columns |= {taken.stamp: at_ns for taken in several if taken.stamp_unit == "date"}
            yield from column_rows(source, columns, at_ns)

    def _require_order(self, at_ns: Stamps) -> None:
        """
        Raises:
            LindyError: so many rows are before the ones above them that the table was shuffled.
        """
        back = np.flatnonzero(np.diff(at_ns) < -BACK_NS)
        if len(back) > max(MOST_BACK, len(at_ns) // 100):
            raise LindyError(
                f"{self._path}: its rows are not in the order of their times ({len(back)} are "
                f"before the one above, the first is at about line {back[0] + 3}); sort it by time"
            )

    def _times(
        self, several: Sequence[TakenMessage]
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """(rows,) [ns] UTC, and where there is one.

        Raises:
            LindyError: the map does not say in which column the time is, or there is none in it.
        """
        taken = several[0]
        names = self._names
        if len({(each.stamp, each.stamp_unit) for each in several}) > 1:
            raise LindyError(
                f"{self._path}: the map names several columns for its time; expected one of a table"
            )
        if taken.stamp not in names:
            listed = ", ".join(names[:SHOWN]) + (" and more" if len(names) > SHOWN else "")
            raise LindyError(
                f"{self._path} has no column {taken.stamp!r} for the time; write at {taken.where} "
                f"in the map stamp = one of {listed}"
            )
        column = self._table[taken.stamp]
        is_date = str(column.type).startswith("timestamp")
        if is_date != (taken.stamp_unit == "date"):
            what = 'dates; write stamp_unit = "date"' if is_date else "no dates; write its unit"
            raise LindyError(f"{self._path}: {taken.stamp} has {what} at {taken.where} in the map")
        whole = np.asarray(column.is_valid())
        if is_date:
            if column.type.tz is None:
                remark = f"the times of {self._path.name} have no zone: taken as UTC"
                self.remarks += [] if remark in self.remarks else [remark]
            found = column.cast("timestamp[ns]").cast("int64").fill_null(0)
            return np.asarray(found), whole
        return self._numbers(column, taken), whole

    def _numbers(self, column: Any, taken: TakenMessage) -> Stamps:
        scale = STAMP_UNITS[taken.stamp_unit]
        is_number = str(column.type).startswith(NUMBERS)
        values = np.asarray(column.fill_null(0)) if is_number else None
        if values is None or taken.stamp_unit == "ros":
            raise LindyError(
                f"{self._path}: {taken.stamp} is {column[0]} with the stamp_unit "
                f"{taken.stamp_unit!r}; write at {taken.where} in the map ns, us, ms, s, or date "
                f"for times as 2024-05-01T09:30:00.123"
            )
        if values.dtype.kind in "iu":
            return values.astype(np.int64) * scale
        return np.round(np.nan_to_num(values) * scale).astype(np.int64)


def _flat_columns(pa: Any, path: Path) -> Any:
    """The columns that a map can name: numbers, times and words. Words stay the few that a column
    repeats.
    """
    parquet: Any = import_module("pyarrow.parquet")
    schema = parquet.ParquetFile(path).schema_arrow
    types, kinds = pa.types, {field.name: field.type for field in schema}
    words = [n for n, kind in kinds.items() if types.is_string(kind) or types.is_large_string(kind)]
    # Of numbers too, and of words that somebody else's program keeps as categories.
    others = (types.is_primitive, types.is_decimal, types.is_dictionary)
    flat = [*words, *(n for n, kind in kinds.items() if any(is_one(kind) for is_one in others))]
    return parquet.read_table(path, columns=flat, read_dictionary=words)


def _refuse_other(path: Path) -> None:
    """
    Raises:
        LindyError: its name says a table, and it holds none.
    """
    if path.suffix.lower() == ".parquet":
        refuse_other(path, PARQUET, "a Parquet table")
        return
    with path.open("rb") as file:
        beginning = file.read(SNIFFED)
    if found := other_kind(beginning):
        raise LindyError(f"{path} is no table: {found}")
    if b"\0" in beginning:
        raise LindyError(f"{path} is no table: it holds bytes that are no text in UTF-8")
