"""Rows of text as a table, and text of strangers that a terminal may show."""

from collections.abc import Sequence


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> str:
    """The first `left` columns begin at the left, the others end at the right."""
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    return "\n".join(_line(row, widths, left) for row in (heads, *rows))


def _line(row: Sequence[str], widths: Sequence[int], left: int) -> str:
    cells = [
        cell.ljust(width) if column < left else cell.rjust(width)
        for column, (cell, width) in enumerate(zip(row, widths, strict=True))
    ]
    return "  ".join(cells).rstrip()


def harmless(text: str) -> str:
    """Without control characters, which a terminal would obey: whoever made a recording may have
    put them into any name and any line of it."""
    return "".join(sign if sign.isprintable() or sign == "\n" else "�" for sign in text)
