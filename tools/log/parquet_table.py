"""Tables as Parquet, with the types of the messages' schemas."""

from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.log.flatten import Row, TableColumn
from tools.log.tables import RowTable, Tables, write_tables
from tools.log.topic_patterns import Topics

BATCH = 20_000  # rows that are kept until they are written


def require_pyarrow() -> None:
    """
    Raises:
        LindyError: it is not installed; says how to get it.
    """
    if find_spec("pyarrow") is None:
        raise LindyError(
            f"Parquet needs pyarrow, which is not installed; {how_to_install('tables')}; or "
            "write CSV with `lindy log csv`"
        )


class ParquetTable:
    """One file."""

    def __init__(self, path: Path, columns: list[TableColumn]) -> None:
        self._pyarrow: Any = import_module("pyarrow")  # it has no types
        parquet: Any = import_module("pyarrow.parquet")
        types = {
            "number": self._pyarrow.float64(),
            "integer": self._pyarrow.int64(),
            "boolean": self._pyarrow.bool_(),
            "string": self._pyarrow.string(),
        }
        self._schema: Any = self._pyarrow.schema([(c.name, types[c.kind]) for c in columns])
        self._file = path.open("xb")
        # Snappy is what every reader of Parquet has; zstd is a seventh smaller.
        self._writer: Any = parquet.ParquetWriter(self._file, self._schema, compression="snappy")
        self._rows: list[Row] = []

    def add(self, row: Row) -> None:
        self._rows.append(row)
        if len(self._rows) >= BATCH:
            self._write()

    def close(self) -> None:
        self._write()
        self._writer.close()
        self._file.close()

    def __del__(self) -> None:
        """What could not be written is not tried again, with a traceback, as it is thrown away."""
        with suppress(AttributeError):  # no file could be opened
            self._writer.is_open = False

    def _write(self) -> None:
        if not self._rows:
            return
        columns = zip(*self._rows, strict=True)
        try:
            arrays = [
                self._pyarrow.array(values, type=kind)
                for values, kind in zip(columns, self._schema.types, strict=True)
            ]
        except (ValueError, TypeError, OverflowError) as error:
            raise LindyError(
                f"{self._file.name}: a message does not fit its own schema: {error}"
            ) from None
        self._writer.write_table(self._pyarrow.Table.from_arrays(arrays, schema=self._schema))
        self._rows.clear()


def parquet_table(path: Path, columns: list[TableColumn]) -> RowTable:
    """
    Raises:
        OSError: it cannot be written, or is there already.
    """
    return ParquetTable(path, columns)


def parquet(recording: Path, *, out: Tables = None, topics: Topics = ()) -> int:
    """Write every topic as a table: one Parquet file each.

    The same tables as CSV, smaller and with types. It needs pyarrow (extra `tables`). RECORDING is
    a dive's folder or its MCAP file. Exit status 3: a message could not be read, or the file is
    damaged or was not finished.

    Example: lindy log parquet dives/latest --out tables
    """
    require_pyarrow()
    return write_tables(recording, out, "parquet", parquet_table, topics)
