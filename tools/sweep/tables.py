"""The table of a sweep, as CSV or Parquet."""

import csv
import io
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.sweep.rows import Cell, Row, columns

SUFFIXES = (".csv", ".parquet")


def check_table(out: Path) -> None:
    """
    Raises:
        LindyError: this kind of table cannot be written here.
    """
    if out.suffix not in SUFFIXES:
        raise LindyError(f"--out {out}: expected a name that ends in {' or '.join(SUFFIXES)}")
    if out.suffix == ".parquet" and find_spec("pyarrow") is None:
        raise LindyError(
            f"--out {out} needs pyarrow, which is not installed; {how_to_install('tables')}; "
            "a table .csv needs nothing"
        )


def encoded(rows: Sequence[Row], settings: list[str], suffix: str) -> bytes:
    """
    Args:
        settings: keys of the axes of --set.
    """
    return _parquet(rows, settings) if suffix == ".parquet" else _csv(rows, settings)


def _csv(rows: Sequence[Row], settings: list[str]) -> bytes:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(columns(settings)), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def _parquet(rows: Sequence[Row], settings: list[str]) -> bytes:
    pyarrow: Any = import_module("pyarrow")  # it has no types
    parquet: Any = import_module("pyarrow.parquet")
    kinds = {"number": pyarrow.float64(), "whole": pyarrow.int64(), "text": pyarrow.string()}
    arrays: dict[str, Any] = {}
    for name, kind in columns(settings).items():
        cells = [row.get(name) for row in rows]
        if kind is None:
            kind = "number" if all(map(_is_number, cells)) else "text"
            cells = cells if kind == "number" else [None if c is None else str(c) for c in cells]
        arrays[name] = pyarrow.array(cells, kinds[kind])
    buffer = pyarrow.BufferOutputStream()
    parquet.write_table(pyarrow.table(arrays), buffer)
    return buffer.getvalue().to_pybytes()


def _is_number(cell: Cell) -> bool:
    return isinstance(cell, int | float)
