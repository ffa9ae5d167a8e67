"""A picture of a sweep: one panel per main figure, one place on the axis per combination."""

import io
from collections.abc import Sequence
from importlib.util import find_spec

from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.sweep.pooled import MAIN, Pooled

WIDE, HIGH = 4.0, 1.8  # [in] at least; per panel
MARKS = {"p50": "o", "p95": "_", "max": "^"}


def check_picture() -> None:
    """
    Raises:
        LindyError: nothing can be drawn here.
    """
    if find_spec("matplotlib") is None:
        raise LindyError(
            f"--picture needs matplotlib, which is not installed; {how_to_install('figures')}"
        )


def drawn(groups: Sequence[Pooled]) -> bytes:
    """A PNG."""
    from matplotlib.figure import Figure

    size = (max(WIDE, 2.0 + 0.6 * len(groups)) + 2.0, HIGH * len(MAIN) + 1.0)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(MAIN), sharex=True)
    places = range(len(groups))
    for axes, main in zip(panels, MAIN, strict=True):
        for n, (name, mark) in enumerate(MARKS.items()):
            spreads = [group.spreads[main.column] for group in groups]
            values = [float("nan") if spread is None else spread[n] for spread in spreads]
            axes.plot(places, values, mark, label=name, color=f"C{n}")
        axes.set_ylabel(f"{main.title}\n[{main.unit}]")
        most = max((s.max for group in groups if (s := group.spreads[main.column])), default=0.0)
        axes.set_ylim(0.0, 1.15 * most or 1.0)
        axes.margins(x=0.1)
        axes.grid(axis="y", alpha=0.3)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    labels = ["\n".join(group.label.values()) or "all dives" for group in groups]
    panels[-1].set_xticks(list(places), labels)
    names = " · ".join(groups[0].label)
    panels[-1].set_xlabel(names or "one combination")
    figure.suptitle(f"{sum(group.dives for group in groups)} simulated dives")
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=110)
    return png.getvalue()
