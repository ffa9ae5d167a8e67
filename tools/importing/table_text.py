"""A table as the world writes it (.csv), to columns: found are its encoding, its delimiter, its
decimal mark and its line of names. What is left out of it is said."""

import csv
import mmap
import re
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import Any

from services.runtime.config.errors import LindyError
from tools.importing.log_file import library, listed
from tools.importing.map_file import QUANTITIES, STAMP_UNITS

ENCODINGS = {b"\xef\xbb\xbf": "utf-8", b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}
UTF8 = re.compile(rb"[\xc2-\xdf][\x80-\xbf]|[\xe0-\xef][\x80-\xbf]{2}")  # no text of Windows has it
HEAD = 3  # [B] that tell the encoding, if any do
AMOUNT = re.compile(r"[-+]?[.,]?\d")  # how a number or a date begins
DELIMITERS = "\t;|,^~\x1f "  # blanks only where nothing else divides it
ZEROS = re.compile("\0+")
SPACE = "\0\x1a\xff"  # behind the end: nothing, the end of a text as DOS marks it, erased flash
COMMENTS = ("#", "%", "//")
BLANK = {"", "--.--", "-.-", "--", "null", "NULL", "None", "NA", "N/A"}  # no sample; NaN is odd
TYPES = {"int", "int32", "int64", "float", "float32", "float64", "double", "str", "string", "bool"}
UNITS = TYPES.union({"", "-"}, STAMP_UNITS, *(each.units for each in QUANTITIES.values()))
SAMPLE = 100  # lines by which the delimiter is found, and by which a torn number is known
PART = 50_000  # rows that are Python's words at a time
# As RE2 reads them.
NUMBER = r"^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$|^[-+]?(?i:nan|inf|infinity)$"
WHOLE = r"^[-+]?\d{1,18}$"
DATE = r"^\d{4}-\d\d-\d\d([T ]\d\d:\d\d.*)?$"
COMMA = r"^[-+]?\d*,\d+([eE][-+]?\d+)?$"
POINT = r"^[-+]?\d*\.\d+([eE][-+]?\d+)?$"


class TableText:
    """One table. Its columns are words until one is asked for."""

    def __init__(self, path: Path, say: Callable[[str], None]) -> None:
        """
        Args:
            say: what is left out of it.

        Raises:
            LindyError: a library is not installed, or it is no table.
        """
        self._pa, self._pc = library("pyarrow", "tables"), library("pyarrow.compute", "tables")
        self.path, self._told = path, say
        self.lines: list[int] = []  # of each row
        self._names: list[str] = []
        self._cut_off = 0  # number of a last line without an end
        self._no_rows: list[int] = []  # lines with other cells than names
        self._recent: deque[list[str]] = deque(maxlen=SAMPLE)
        parts = [self._pa.table(part) for part in self._parts()]
        if len(self._no_rows) > len(self.lines):
            raise LindyError(
                f"{path} is damaged or no table: {len(self._no_rows)} lines do not have the "
                f"{len(self._names)} cells of its names, the first is line {self._no_rows[0]}"
            )
        if not self.lines:
            raise LindyError(f"{path} has no rows below its names of columns")
        if self._no_rows:
            lines = "1 line is" if len(self._no_rows) == 1 else f"{len(self._no_rows)} lines are"
            self._say(f"{lines} damaged and left out, the first is line {self._no_rows[0]}")
        self.words: Any = self._pa.concat_tables(parts)
        self._comma = self._has_decimal_comma()

    def _say(self, remark: str) -> None:
        self._told(f"{self.path.name}: {remark}")

    def column(self, name: str) -> Any:
        """Of Arrow: numbers, dates or words. A cell that is no number where most are is NaN."""
        words, pc = self.words[name], self._pc
        points = pc.replace_substring(words, ",", ".") if self._comma else words
        numbers = pc.replace_substring_regex(points, r"^\+", "")
        is_number = pc.match_substring_regex(numbers, NUMBER)
        filled = len(words) - words.null_count
        count = pc.sum(is_number).as_py() or 0
        if 2 * count > filled or not filled:
            if count < filled:
                row = pc.index(is_number, False).as_py()
                bad = filled - count
                self._say(
                    f"{name} is {words[row].as_py()!r} in line {self.lines[row]}, which is no "
                    f"number; {bad} of its {filled} cells {'is' if bad == 1 else 'are'} none"
                )
                numbers = pc.if_else(is_number, numbers, "nan")
            is_whole = pc.all(pc.match_substring_regex(numbers, WHOLE)).as_py()
            return numbers.cast(self._pa.int64() if is_whole else self._pa.float64())
        dates = pc.replace_substring_regex(words, r"(:\d\d),(\d)", r"\1.\2")
        is_date = pc.match_substring_regex(dates, DATE)
        if 2 * (pc.sum(is_date).as_py() or 0) > filled:
            dates = pc.if_else(is_date, dates, None)
            for kind in (self._pa.timestamp("ns"), self._pa.timestamp("ns", "UTC")):
                try:
                    return dates.cast(kind)
                except self._pa.ArrowInvalid:
                    continue
        return words

    def _has_decimal_comma(self) -> bool:
        """Most of its numbers that are not whole."""
        pc, more = self._pc, 0
        for name in self.words.column_names:
            for pattern, sign in ((COMMA, 1), (POINT, -1)):
                matching = pc.match_substring_regex(self.words[name], pattern)
                more += sign * (pc.sum(matching).as_py() or 0)
        return more > 0

    def _parts(self) -> Iterator[dict[str, Any]]:
        """Words by column, of at most so many rows."""
        rows: list[list[str]] = []
        for line, cells in self._rows():
            if line == self._first_line:
                self._names = _unique(cells)
                continue
            if not self._names or cells[0].startswith(COMMENTS):
                continue
            while len(cells) > len(self._names) and not cells[-1]:
                cells.pop()
            is_row = any(map(AMOUNT.match, cells))  # else it is of units, or has the names again
            if not is_row and not self.lines:
                self._say(f"line {line} is no row: {listed([*filter(None, cells)])}")
            elif line == self._cut_off and self._is_torn(cells):
                self._say(f"its last row, line {line}, was cut off and is left out")
            elif not is_row and self._are_other_names(cells):
                raise LindyError(
                    f"{self.path}: from line {line} on it has other names of columns; make a "
                    f"table of each part"
                )
            elif not is_row or len(cells) != len(self._names) or "\0" in "".join(cells):
                self._no_rows.append(line)
            else:
                rows.append(cells)
                self.lines.append(line)
                self._recent.append(cells)
            if len(rows) == PART:
                yield self._columns(rows)
                rows = []
        yield self._columns(rows)

    def _columns(self, rows: Sequence[Sequence[str]]) -> dict[str, Any]:
        columns = zip(*rows, strict=True) if rows else ((),) * len(self._names)
        return {
            name: self._pa.array([None if c in BLANK else c for c in cells], self._pa.string())
            for name, cells in zip(self._names, columns, strict=True)
        }

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Number of the line, and its cells."""
        lines = self._text()
        sample = list(islice(lines, SAMPLE))
        if sample and sample[0].lower().startswith("sep="):  # so Excel is told
            self._delimiter, sample[0] = sample[0][4], "\n"
        else:
            self._delimiter = max(DELIMITERS, key=lambda each: _agreeing(sample, each))
        self._first_line = _line_of_names([*_cells(sample, self._delimiter)])
        if not self._first_line:
            raise LindyError(f"{self.path} has no names of columns above its rows")
        rows = _cells(chain(sample, lines), self._delimiter)
        yield from (row for row, _ in pairwise(chain(rows, [(0, [])])))  # a cut is known behind it

    def _text(self) -> Iterator[str]:
        """Lines without marks of order. Zero bytes, as power cuts leave them, are one, which is in
        no sound row; behind the end they are nothing."""
        with self.path.open("rb") as file:
            head = file.read(HEAD)
        encoding = next((e for mark, e in ENCODINGS.items() if head.startswith(mark)), "")
        if not encoding and b"\0" in (head[:1], head[1:2]):
            encoding = "utf-16-be" if head[:1] == b"\0" else "utf-16-le"
        encoding = encoding or ("utf-8" if _is_utf8(self.path) else "cp1252")
        number, line = 0, "\n"
        with self.path.open(encoding=encoding, errors="replace", newline="") as file:
            for line in file:
                number += 1
                if words := ZEROS.sub("\0", line.replace("\ufeff", "")).rstrip(SPACE):
                    yield words
        if not line.endswith(("\n", "\r")):
            self._cut_off = number

    def _are_other_names(self, cells: Sequence[str]) -> bool:
        """Does a name stand above another column than in the first line?"""
        names = [name.casefold() for name in self._names]
        return any(
            name in names and names.index(name) != place
            for place, name in enumerate(each.casefold() for each in _bare(cells))
        )

    def _is_torn(self, cells: Sequence[str]) -> bool:
        """The file ends in it without a line's end: it lacks cells, or its last one is shorter
        than those above."""
        if len(cells) != len(self._names) or "\0" in cells[-1]:
            return True
        above = [row[-1] for row in self._recent if row[-1]]
        return bool(above) and len(cells[-1]) < min(map(len, above))


def _is_utf8(path: Path) -> bool:
    """Has it a letter of several bytes?"""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        return UTF8.search(data) is not None


def _cells(lines: Iterable[str], delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Of each line that has any, and its number."""
    if delimiter == " ":
        lines = (line.strip(" ") for line in lines)
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
    while True:
        try:
            if any(cells := [cell.strip() for cell in next(reader)]):
                yield reader.line_num, cells
        except csv.Error:  # a cell without an end
            yield reader.line_num, ["\0"]
        except StopIteration:
            return


def _agreeing(lines: Sequence[str], delimiter: str) -> float:
    """[-] Share of the rows that this divides into the same number of cells, two or more."""
    widths = [len(cells) for _, cells in _cells(lines, delimiter) if not _is_comment(cells)]
    counts = Counter(width for width in widths if width > 1)
    return max(counts.values(), default=0) / max(1, len(widths))


def _line_of_names(rows: Sequence[tuple[int, list[str]]]) -> int:
    """Its number: the last line of words above the numbers that is not of units; else such a
    comment. 0: there is none."""
    whole = [(line, cells) for line, cells in rows if not _is_comment(cells)]
    if not whole:
        return 0
    width, _ = Counter(len(cells) for _, cells in whole).most_common(1)[0]
    if all(not cells[-1] for _, cells in whole if len(cells) == width):
        width -= 1  # a delimiter is behind the last cell
    table = [(line, cells[:width]) for line, cells in whole if len(cells) >= width]
    kinds = [tuple(AMOUNT.match(cell) is not None for cell in cells) for _, cells in table]
    usual = Counter(kind for kind in kinds if any(kind)).most_common(1)
    first = kinds.index(usual[0][0]) if usual else len(kinds)
    words = [row for row, kind in zip(table[:first], kinds, strict=False) if not any(kind)]
    until = table[first][0] if usual else rows[-1][0]
    comments = [(line, _bare(cells)) for line, cells in rows if line < until and _is_comment(cells)]
    words = words or [row for row in comments if len(row[1]) == width] or table[: min(first, 1)]
    names = [line for line, cells in words if not _are_units(cells)]
    return names[-1] if names else 0


def _are_units(cells: Sequence[str]) -> bool:
    """Or types: most of them."""
    return 2 * sum(cell in UNITS for cell in _bare(cells, "#%/[]() ")) > len(cells)


def _bare(cells: Sequence[str], marks: str = "#%/ ") -> list[str]:
    """Names without what marks a comment or a unit."""
    return [" ".join(cell.split()).strip(marks) for cell in cells]


def _is_comment(cells: Sequence[str]) -> bool:
    return cells[0].startswith(COMMENTS)


def _unique(cells: Sequence[str]) -> list[str]:
    """A name of its own for each column."""
    found: list[str] = []
    for number, name in enumerate(_bare(cells), 1):
        name = name or f"column {number}"
        found.append(name if name not in found else f"{name} ({number})")
    return found
