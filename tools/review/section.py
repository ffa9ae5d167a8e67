"""What the sections of a review are made of: sentences, tables and pictures in one HTML page that
loads nothing from elsewhere."""

import io
from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from math import degrees
from typing import TYPE_CHECKING

import numpy as np

from tools.recordings.columns import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

WIDTH = 9.0  # [in]
DPI = 100
MOST_POINTS = 4000  # of a line: more cannot be seen
OURS, OWN = "C0", "C1"  # colours
Cell = str | float | None


class ReviewSection:
    """One section of the page."""

    key = ""  # in `Review.missing`
    heading = ""

    def __init__(self, missing: Sequence[str] = ()) -> None:
        """
        Args:
            missing: what it lacks, in sentences.
        """
        self.missing = [*missing]

    def sentences(self) -> Iterator[str]:
        """In short, for the owner of the vehicle."""
        yield from ()

    def html(self) -> str:
        """Below its heading and what is missing."""
        return ""

    def whole(self) -> str:
        """All of it, as HTML."""
        lacks = "".join(f'<p class="missing">{escape(line)}</p>' for line in self.missing)
        return f'<h2 id="{self.key}">{escape(self.heading)}</h2>{lacks}{self.html()}'


def amount(value: float, unit: str) -> str:
    """[SI] As a person reads it: 0.12 m is 12 cm, radians are degrees."""
    if unit.startswith("rad"):
        return f"{degrees(value):.3g} °{unit[3:]}"
    if unit in ("m", "m/s") and abs(value) < 1.0:
        return f"{100.0 * value:.3g} c{unit}"
    return f"{value:.3g} {unit}"


def signed(value: float, unit: str) -> str:
    return f"{'+' if value > 0.0 else ''}{amount(value, unit)}"


def table(heads: Sequence[str], rows: Iterable[Sequence[Cell]], words: int = 0) -> str:
    """`words`: how many of the last columns are words."""

    def line(tag: str, cells: Sequence[Cell]) -> str:
        kinds = [""] * (len(heads) - words) + [' class="words"'] * words
        inner = (f"<{tag}{k}>{escape(_cell(c))}</{tag}>" for k, c in zip(kinds, cells, strict=True))
        return f"<tr>{''.join(inner)}</tr>"

    return f"<table>{line('th', heads)}{''.join(line('td', row) for row in rows)}</table>"


def _cell(value: Cell) -> str:
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    return f"{value:d}" if isinstance(value, int) else f"{value:.4g}"


def paragraph(text: str) -> str:
    return f"<p>{escape(text)}</p>"


def listed(heading: str, lines: Sequence[str]) -> str:
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"{paragraph(heading)}<ul>{items}</ul>" if lines else ""


def figure(height: float) -> "Figure":
    """
    Args:
        height: [in]
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained")


def image(drawn: "Figure", alt: str) -> str:
    png = io.BytesIO()
    drawn.savefig(png, format="png", dpi=DPI)
    data = b64encode(png.getvalue()).decode()
    return f'<p><img alt="{escape(alt)}" src="data:image/png;base64,{data}"></p>'


def legend_above(drawn: "Figure", panels: Sequence["Panel"]) -> None:
    named = {
        label: handle
        for panel in panels
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    drawn.legend(named.values(), named.keys(), loc="outside upper center", ncols=3)


def thinned(t: Array, values: Array) -> tuple[Array, Array]:
    """At most `MOST_POINTS`: of each stretch the least and the greatest, in their order."""
    step = -(-2 * len(t) // MOST_POINTS)
    if step <= 2:
        return t, values
    whole = len(t) // step * step
    blocks = values[:whole].reshape(-1, step)
    ends = np.sort(np.column_stack([blocks.argmin(axis=1), blocks.argmax(axis=1)]), axis=1)
    rows = (ends + np.arange(0, whole, step)[:, None]).ravel()
    return t[rows], values[rows]
