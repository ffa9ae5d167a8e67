"""The main figures of a sweep for each combination of its axes, over all seeds."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tools.sweep.rows import CLEAN, Row


class MainFigure(NamedTuple):
    column: str
    title: str
    unit: str
    factor: float  # from the column's unit
    digits: int


class Spread(NamedTuple):
    """Over the dives of one combination."""

    p50: float
    p95: float
    max: float


class Pooled(NamedTuple):
    """All dives of one combination."""

    label: dict[str, str]  # value of each axis that has several
    dives: int
    failed: int  # dives that ended with an error
    failsafes: int
    spreads: dict[str, Spread | None]  # by column; None: measured in no dive


MAIN = (
    MainFigure("depth_overshoot_max_m", "depth overshoot", "cm", 100.0, 1),
    MainFigure("turn_overshoot_max_deg", "turn overshoot", "°", 1.0, 1),
    MainFigure("depth_error_rms_m", "depth error rms", "cm", 100.0, 2),
    MainFigure("heading_error_rms_deg", "heading error rms", "°", 1.0, 2),
    MainFigure("energy_wh", "energy", "Wh", 1.0, 3),
)


def pooled(rows: Sequence[Row], varied: Sequence[str]) -> list[Pooled]:
    """In the order in which the combinations first appear.

    Args:
        varied: names of the axes that have several values, without the seed.
    """
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(str(row[name]) for name in varied), []).append(row)
    return [
        Pooled(
            label=dict(zip(varied, values, strict=True)),
            dives=len(group),
            failed=sum(row["end"] != CLEAN for row in group),
            failsafes=sum(int(row["failsafes"] or 0) for row in group),
            spreads={main.column: _spread(group, main) for main in MAIN},
        )
        for values, group in groups.items()
    ]


def _spread(rows: Sequence[Row], main: MainFigure) -> Spread | None:
    values = [main.factor * float(v) for row in rows if (v := row[main.column]) is not None]
    if not values:
        return None
    p50, p95 = np.percentile(values, [50, 95]).tolist()
    return Spread(p50, p95, max(values))


def lines(groups: Sequence[Pooled]) -> list[str]:
    """A table for a terminal: p50 / p95 / max over the dives of each combination."""
    axes: Mapping[str, str] = groups[0].label if groups else {}
    heads = [*axes, "dives", *(f"{main.title} [{main.unit}]" for main in MAIN), "failsafes"]
    table = [heads, *(_cells(group) for group in groups)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    ]


def _cells(group: Pooled) -> list[str]:
    failed = f" ({group.failed} failed)" if group.failed else ""
    spreads = [_text(group.spreads[main.column], main.digits) for main in MAIN]
    return [*group.label.values(), f"{group.dives}{failed}", *spreads, str(group.failsafes)]


def _text(spread: Spread | None, digits: int) -> str:
    return "-" if spread is None else " / ".join(f"{value:.{digits}f}" for value in spread)
