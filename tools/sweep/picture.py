"""A picture of a sweep: one panel per main figure, one place on the axis per combination."""

import io
from collections.abc import Sequence
from typing import NamedTuple

from tools.sweep.rows import Row

WIDE, HIGH = 4.0, 1.8  # [in] at least; per panel


class MainFigure(NamedTuple):
    column: str
    title: str
    unit: str
    factor: float  # from the column's unit


MAIN = (
    MainFigure("depth_overshoot_max_m", "depth overshoot", "cm", 100.0),
    MainFigure("turn_overshoot_max_deg", "turn overshoot", "°", 1.0),
    MainFigure("depth_error_rms_m", "depth error rms", "cm", 100.0),
    MainFigure("heading_error_rms_deg", "heading error rms", "°", 1.0),
    MainFigure("energy_wh", "energy", "Wh", 1.0),
)


def combinations(rows: Sequence[Row], varied: Sequence[str]) -> dict[str, list[Row]]:
    """The dives of each combination of the axes, in the order in which these first appear.

    Args:
        varied: names of the axes that have several values, without the seed.
    """
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault("\n".join(str(row[name]) for name in varied), []).append(row)
    return found


def drawn(rows: Sequence[Row], varied: Sequence[str]) -> bytes:
    """A PNG: a dot for each dive. A figure that no dive has gets no panel.

    Args:
        varied: as `combinations` takes it.
    """
    from matplotlib.figure import Figure

    groups = combinations(rows, varied)
    mains = [m for m in MAIN if any(row[m.column] is not None for row in rows)] or [MAIN[-1]]
    size = (max(WIDE, 2.0 + 0.6 * len(groups)) + 2.0, HIGH * len(mains) + 1.0)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(mains), sharex=True, squeeze=False)[:, 0]
    for axes, main in zip(panels, mains, strict=True):
        for place, group in enumerate(groups.values()):
            found = [main.factor * float(v) for row in group if (v := row[main.column]) is not None]
            axes.plot([place] * len(found), found, "o", color="C0", alpha=0.6, markersize=4.0)
        axes.set_ylabel(f"{main.title}\n[{main.unit}]")
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.1)
        axes.grid(axis="y", alpha=0.3)
    panels[-1].set_xticks(range(len(groups)), [label or "all dives" for label in groups])
    panels[-1].set_xlabel(" · ".join(varied) or "one combination")
    figure.suptitle(f"{len(rows)} simulated dive{'s' * (len(rows) != 1)}")
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=110)
    return png.getvalue()
