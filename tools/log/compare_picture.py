"""Two dives in one picture: depth, heading and power over time, and how far the depths differ."""

import io
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from messages import topics
from messages.topic import AnyTopic
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.fresh import refuse_existing
from tools.log.differences import zeros
from tools.log.series import Array, DiveSeries

SIZE = (10.0, 9.0)  # [in]
STYLES = ("-", "--")  # of A and of B, which may lie upon each other


class Panel(NamedTuple):
    title: str
    unit: str
    scale: float  # from the unit of the messages
    down: bool  # larger values are drawn lower
    sources: tuple[tuple[AnyTopic, str], ...]  # the first that a recording has


PANELS = (
    Panel(
        "depth", "m", 1.0, True, ((topics.TRUTH, "position.down"), (topics.STATE, "depth.value"))
    ),
    Panel("depth asked for", "m", 1.0, True, ((topics.REFERENCE, "depth.position"),)),
    Panel("heading", "°", 180.0 / np.pi, False, ((topics.STATE, "heading.value"),)),
    Panel("power", "W", 1.0, False, ((topics.ACTUATION, "power"),)),
)


def check_picture(out: Path) -> None:
    """Check, before anything is read, that it can be drawn and written.

    Raises:
        LindyError: it cannot.
    """
    if out.suffix != ".png":
        raise LindyError(f"--out {out}: expected a name that ends in .png")
    if find_spec("matplotlib") is None:
        raise LindyError(
            f"a picture needs matplotlib, which is not installed; {how_to_install('figures')}"
        )
    refuse_existing(out)


def drawn(a: DiveSeries, b: DiveSeries, names: Sequence[str]) -> bytes:
    """A PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, layout="constrained")
    rows = figure.subplots(len(PANELS) + 1, sharex=True)
    zero = zeros(a, b)
    for axes, panel in zip(rows, PANELS, strict=False):
        for dive, began, name, style in zip((a, b), zero, names, STYLES, strict=True):
            if (line := _line(dive, panel, began)) is not None:
                axes.plot(*line, style, label=name, linewidth=1.2)
        axes.set_ylabel(f"{panel.title}\n[{panel.unit}]")
        axes.grid(alpha=0.3)
        if panel.down:
            axes.invert_yaxis()
    last = rows[-1]
    lines = [_line(dive, PANELS[0], began) for dive, began in zip((a, b), zero, strict=True)]
    if lines[0] is not None and lines[1] is not None:
        times, values = lines[0]
        inside = (times >= lines[1][0][0]) & (times <= lines[1][0][-1])
        other = np.interp(times[inside], *lines[1])
        last.plot(times[inside], 100.0 * (other - values[inside]), color="C3", linewidth=1.2)
    last.set_ylabel("B - A\ndepth [cm]")
    last.grid(alpha=0.3)
    armed = zero == (a.armed_ns, b.armed_ns)
    last.set_xlabel(f"time since {'arming' if armed else 'the recordings began'} [s]")
    labelled = next((axes for axes in rows if axes.lines), None)
    if labelled is not None:
        figure.legend(*labelled.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=110)
    return png.getvalue()


def _line(dive: DiveSeries, panel: Panel, zero_ns: int) -> tuple[Array, Array] | None:
    for topic, column in panel.sources:
        if (found := dive.of(topic, column)) is not None:
            times, values = found
            return (times - zero_ns) / 1e9, panel.scale * values
    return None
