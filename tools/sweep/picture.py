"""A picture of a sweep: one panel per main figure, one place on the axis per combination."""

import io
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.fresh import refuse_existing
from tools.sweep.pooled import MAIN, Pooled

WIDE, HIGH = 4.0, 1.8  # [in] at least; per panel
MARKS = {"p50": "o", "p95": "_", "max": "^"}


def check_picture(picture: Path) -> None:
    """Check, before the first dive, that it can be drawn and written.

    Raises:
        LindyError: it cannot.
    """
    if picture.suffix != ".png":
        raise LindyError(f"--picture {picture}: expected a name that ends in .png")
    if find_spec("matplotlib") is None:
        raise LindyError(
            f"--picture needs matplotlib, which is not installed; {how_to_install('figures')}"
        )
    refuse_existing(picture, "--picture")
    folder = next(path for path in picture.absolute().parents if path.exists())
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass  # it can be written to
    except OSError as error:
        raise LindyError(f"cannot write --picture {picture}: {reason(error)}") from None


def drawn(groups: Sequence[Pooled]) -> bytes:
    """A PNG. A figure that no dive has gets no panel."""
    from matplotlib.figure import Figure

    mains = [m for m in MAIN if any(g.spreads[m.column] for g in groups)] or list(MAIN[-1:])
    size = (max(WIDE, 2.0 + 0.6 * len(groups)) + 2.0, HIGH * len(mains) + 1.0)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(mains), sharex=True, squeeze=False)[:, 0]
    places = range(len(groups))
    for axes, main in zip(panels, mains, strict=True):
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
    dives = sum(group.dives for group in groups)
    figure.suptitle(f"{dives} simulated dive{'s' * (dives != 1)}")
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=110)
    return png.getvalue()
