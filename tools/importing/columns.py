"""Rows of logs that have columns: pure. A row's fields are its cells by the columns' names, which
may hold dots and brackets."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tools.importing.log_file import BlankError, LogRow
from tools.importing.map_file import TakenMessage

CHUNK = 10_000  # rows that are Python's numbers at a time


class ColumnArray(Protocol):
    """An array of NumPy or of Arrow."""

    def __getitem__(self, rows: slice, /) -> Any: ...


def cell(name: str) -> Callable[[Any], Any]:
    """What takes the cell of this column out of a row's fields. It raises BlankError where nothing
    is in it."""

    def taken(fields: Any) -> Any:
        found = fields.get(name)
        if found is None:
            raise BlankError(name)
        return found

    return taken


def named_columns(several: Sequence[TakenMessage]) -> set[str]:
    """All that these parts of a map name."""
    names = {name for taken in several for field in taken.fields.values() for name in field.from_}
    names |= {name for taken in several for name in taken.only}
    return names | {taken.stamp for taken in several if taken.stamp}


def column_rows(
    source: str, columns: Mapping[str, ColumnArray], at_ns: NDArray[np.int64]
) -> Iterator[LogRow]:
    """
    Args:
        at_ns: (n,) [ns] UTC of each row.
    """
    for begin in range(0, len(at_ns), CHUNK):
        part = slice(begin, begin + CHUNK)
        cells = zip(*(column[part].tolist() for column in columns.values()), strict=True)
        for at, row in zip(at_ns[part].tolist(), cells, strict=True):
            yield LogRow(source, dict(zip(columns, row, strict=True)), at)
