"""The finished dives of a sweep, in an append-only file of JSON lines beside the table.

The first line says what the sweep is, and every other line is the row of one dive. A killed program
can leave an incomplete last line, which is removed when the sweep goes on.
"""

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.os import system
from tools.fresh import write_fresh
from tools.sweep.rows import Row

SUFFIX = ".rows.jsonl"
FORMAT = "lindy sweep"  # key of the first line; its value is the format's number

About = dict[str, Any]  # what a sweep is: JSON, one key for everything that may differ


def rows_file(table: Path) -> Path:
    return table.with_name(table.name + SUFFIX)


class FinishedDives:
    """The rows so far. Keep it open while the sweep goes on: it locks the file."""

    def __init__(self, table: Path, about: About) -> None:
        """Begin a sweep, or go on with one.

        Raises:
            LindyError: it cannot be written; it is of another sweep, or is not a sweep's; another
                program is at it; or there is a table and no rows of a sweep.
        """
        self._table = table
        self._path = rows_file(table)
        self.rows: dict[int, Row] = {}  # by the dive's number
        begun = self._path.exists()
        if table.exists() and not begun:
            raise LindyError(
                f"cannot write {table}: it exists already, and there is no {self._path.name} of a "
                "sweep to go on with; choose another --out"
            )
        try:
            table.parent.mkdir(parents=True, exist_ok=True)
            if not begun:
                write_fresh(self._path, _line({FORMAT: 1, **about}))
            lock = system.lock(self._path)
            if lock is None:
                raise LindyError(f"another lindy sweep is at work on {self._path}")
            self._lock = lock
            self._file = self._path.open("r+b")
        except OSError as error:
            raise LindyError(f"cannot write {self._path}: {reason(error)}") from None
        try:
            self._read(about)
        except LindyError:
            self.close()
            raise

    def add(self, row: Row) -> None:
        """
        Raises:
            LindyError: the row cannot be written; those before it are.
        """
        try:
            self._file.write(_line(row))
            self._file.flush()
        except OSError as error:
            raise LindyError(f"cannot write {self._path}: {reason(error)}") from None
        self._keep(row)

    def replace_table(self, data: bytes) -> None:
        """Write the table, whole or not at all, in the place of the one before.

        Raises:
            LindyError: it cannot be written; the one before stays, and so do the rows.
        """
        fresh = self._table.with_name(f".{self._table.name}-{os.getpid()}")
        try:
            fresh.write_bytes(data)
            fresh.replace(self._table)
        except OSError as error:
            raise LindyError(
                f"cannot write {self._table}: {reason(error)}; all finished dives are safe in "
                f"{self._path}, and the same command writes the table"
            ) from None
        finally:
            fresh.unlink(missing_ok=True)

    def close(self) -> None:
        with suppress(OSError):  # of a row that was not written, which was said
            self._file.close()
        self._lock.release()

    def _read(self, about: About) -> None:
        data = self._file.read()
        whole = data.rfind(b"\n") + 1
        first, *lines = data[:whole].split(b"\n")[:-1] or [b""]
        self._check(_parsed(first), about)
        self._file.seek(whole)
        self._file.truncate()  # what a killed program left of a row
        for number, line in enumerate(lines, 2):
            row = _parsed(line)
            if "dive" not in row:
                raise LindyError(f"{self._path}:{number}: this is not the row of a dive")
            self._keep(row)

    def _keep(self, row: Row) -> None:
        number = row["dive"]
        assert isinstance(number, int)
        self.rows[number] = row

    def _check(self, found: About, about: About) -> None:
        if FORMAT not in found:
            raise LindyError(f"{self._path} is not the file of a sweep; choose another --out")
        wanted = json.loads(json.dumps({FORMAT: 1, **about}))
        for key in {**wanted, **found}:
            here, there = wanted.get(key), found.get(key)
            if there != here:
                raise LindyError(
                    f"{self._path} is of another sweep: {key} is {_short(there)} there and "
                    f"{_short(here)} here; choose another --out"
                )


def _line(entry: Row | About) -> bytes:
    return json.dumps(entry, ensure_ascii=False, allow_nan=False).encode() + b"\n"


def _parsed(line: bytes) -> dict[str, Any]:
    """Empty where it is no object."""
    try:
        entry = json.loads(line)
    except ValueError:
        return {}
    return entry if isinstance(entry, dict) else {}  # pyright: ignore[reportUnknownVariableType]


def _short(value: object) -> str:
    if value is None:
        return "not given"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else text[:60] + "…"
