"""One figure of a benchmark beside its baseline, and how a list of them is shown."""

import sys
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table

COLUMNS = ("", "ours", "baseline", "", "ratio", "goal", "")


@dataclass(frozen=True, kw_only=True)
class Figure:
    """Cost of one of our ways beside another's, measured in the same run.

    Only the ratio is judged, never a time: times change with machine and neighbours. Where the
    goal is absolute, baseline is the goal itself.
    """

    section: str
    name: str
    unit: str  # of ours and baseline
    ours: float | None = None  # None: not measured, and `note` says why
    baseline_name: str = ""
    baseline: float | None = None
    goal: float | None = None  # the ratio should not be above this; None: shown, not judged
    note: str = ""

    @property
    def ratio(self) -> float | None:
        if self.ours is None or self.baseline is None:
            return None
        return self.ours / self.baseline

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None where there is nothing to judge."""
        if self.goal is None or self.ratio is None:
            return None
        return self.ratio <= self.goal


def show(figures: list[Figure]) -> None:
    """A coloured table on a terminal, aligned plain text elsewhere."""
    rows = [_cells(figure) for figure in figures]
    if not sys.stdout.isatty():
        widths = [max(map(len, column)) for column in zip(COLUMNS, *rows, strict=True)]
        for row in (COLUMNS, *rows):
            cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            print("  ".join(cells).rstrip(), flush=True)
        return
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
    for title in COLUMNS:
        table.add_column(title, justify="left" if title in ("", "baseline") else "right")
    for figure, row in zip(figures, rows, strict=True):
        colour = {True: "green", False: "red", None: "dim"}[figure.met]
        table.add_row(*row[:-1], f"[{colour}]{row[-1]}[/]")
    Console().print(table)


def _cells(figure: Figure) -> tuple[str, ...]:
    verdict = {True: "met", False: "missed", None: ""}[figure.met]
    return (
        f"{figure.section}: {figure.name}",
        _number(figure.ours, f".4g {figure.unit}"),
        figure.baseline_name,
        _number(figure.baseline, f".4g {figure.unit}"),
        _number(figure.ratio, ".3g"),
        _number(figure.goal, ".3g"),
        "; ".join(filter(None, (verdict, figure.note))),
    )


def _number(value: float | None, form: str) -> str:
    if value is None:
        return "-"
    precision, _, unit = form.partition(" ")
    return f"{value:{precision}} {unit}".rstrip()
