"""How every figure looks: colours, sizes, captions, and files that are the same on every run."""

import re
import textwrap
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

Look = dict[str, Any]  # how a line is drawn

# One meaning, one colour, in every figure; all of them colour-blind safe (Okabe and Ito).
TARGET = "#CC79A7"  # what the pilot asks for
DIRECT = "#E69F00"  # direct integration
FILTER = "#009E73"  # linear filter
MINIMUM_TIME = "#D55E00"
PAPER = "#0072B2"  # the method of the paper the figure is from
LINDY = "#000000"  # what Lindy does instead
LIMIT = "#777777"  # limits, and where parts begin
FAMILY = ["#0072B2", "#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7", "#000000"]

DPI = 150
CAPTION_WIDTH = 128  # characters
SETTINGS: dict[Any, Any] = {
    "svg.hashsalt": "lindy",  # otherwise the names inside an SVG are random
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same on every machine
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "lines.linewidth": 1.6,
    "legend.fontsize": 9,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "figure.facecolor": "white",
}
THEIRS: Look = {"color": PAPER}
OURS: Look = {"color": LINDY, "linestyle": (0, (5, 2)), "linewidth": 1.4}
ASKED: Look = {"color": TARGET, "linestyle": "--", "linewidth": 1.3}
EDGE: Look = {"color": LIMIT, "linestyle": ":", "linewidth": 1.0}


def in_style() -> AbstractContextManager[None]:
    """Inside it, matplotlib draws as said here."""
    return mpl.rc_context(SETTINGS)


def sheet(width: float, height: float) -> Figure:
    """An empty figure [inch], laid out without overlaps."""
    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def stacked(figure: Figure, *labels: str, x: str = "time [s]") -> list[Axes]:
    """Panels above each other with one x axis, each with its y label."""
    return above_each_other(figure, labels, [1.0] * len(labels), x)


def above_each_other(
    figure: Figure, labels: Sequence[str], heights: Sequence[float], x: str, below: int = 0
) -> list[Axes]:
    """Panels of different heights; the last `below` of them have x axes of their own."""
    grid = figure.add_gridspec(len(labels), 1, height_ratios=list(heights))
    shared = len(labels) - below
    panels: list[Axes] = []
    for row, label in enumerate(labels):
        first = panels[0] if 0 < row < shared else None
        panel = figure.add_subplot(grid[row, 0], sharex=first)
        panel.set_ylabel(label)
        panel.tick_params(labelbottom=row >= shared - 1)
        panels.append(panel)
    panels[shared - 1].set_xlabel(x)
    figure.align_ylabels(panels)
    return panels


def legend(panel: Axes, columns: int = 1) -> None:
    """A legend beside the panel's top edge, where it covers no curve."""
    panel.legend(
        ncols=columns, handlelength=2.4, columnspacing=1.4, loc="lower right",
        bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1,
    )  # fmt: skip


def finish(figure: Figure, title: str, caption: str) -> None:
    """Title above, caption below."""
    figure.suptitle(title, fontsize=11.5, fontweight="bold", x=0.01, ha="left")
    width = int(CAPTION_WIDTH * figure.get_figwidth() / 8)
    unbroken = re.sub(r"(?<=\d) (?=(m|s|ms|mm|rad|%)\b|%)", "\u00a0", caption)
    text = "\n".join(textwrap.wrap(unbroken, width))
    figure.supxlabel(text, fontsize=8.2, color="#333333", x=0.01, ha="left")


def save(figure: Figure, stem: Path) -> None:
    """`stem`.png and `stem`.svg, byte for byte the same on every run.

    Raises:
        OSError: a file cannot be written.
    """
    with in_style():
        _settle(figure)
        figure.savefig(f"{stem}.png", dpi=DPI)
        figure.savefig(f"{stem}.svg", metadata={"Date": None})


def _settle(figure: Figure) -> None:
    """Lay the panels out once and round where they are: the last bits of a layout depend on the
    order in which it is solved, and the names inside an SVG are made from them."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for panel in figure.axes:
        left, bottom, width, height = panel.get_position(original=True).bounds
        panel.set_position((round(left, 6), round(bottom, 6), round(width, 6), round(height, 6)))
