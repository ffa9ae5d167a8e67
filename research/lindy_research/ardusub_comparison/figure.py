"""The figure of docs/ardusub.md."""

from collections.abc import Sequence
from pathlib import Path
from statistics import median

import numpy as np
from matplotlib.axes import Axes

from lindy_research.ardusub_comparison.flights import Flight
from lindy_research.papers.style import DPI, LINDY, PAPER, finish, in_style, sheet

FIGURES = (
    ("beyond the resting depth [mm]", "bounce"),
    ("then swung back short of it [mm]", "short"),
    ("stopping distance [mm]", "stopping"),
)
COLOURS = {"Lindy": LINDY, "ALT_HOLD": PAPER}


def draw(flights: Sequence[Flight], path: Path) -> None:
    """
    Raises:
        OSError: the file cannot be written.
    """
    with in_style():
        figure = sheet(10.0, 7.4)
        above, below = figure.subplots(2, 1, height_ratios=(1.0, 1.3))
        _dives(above, flights)
        left, *others = _split(below)
        _releases(left, flights)
        for panel, (label, what) in zip(others, FIGURES, strict=True):
            _figures(panel, flights, label, what)
        finish(
            figure,
            "Full heave stick let go: Lindy and ArduSub's ALT_HOLD on ArduSub's own simulator",
            "Eight releases each at full speed, four of them sinking (solid, filled) and four "
            "rising (dotted, open). Depth and speed are those of the simulator itself (SIM_STATE), "
            "not of a sensor. Travelled: integral of the speed since the stick was centred, in the "
            "direction of motion. Lines across: median.",
        )
        figure.savefig(path, dpi=DPI)


def summary(flight: Flight) -> str:
    """One line, medians and ranges."""
    found = [f"{flight.name:9s}", _range(flight, "speed", 1.0, "m/s at the release", "2f")]
    found.append(_range(flight, "stopping", 1e3, "mm stopping distance", "0f"))
    found.append(_range(flight, "bounce", 1e3, "mm beyond the resting depth", "1f"))
    found.append(_range(flight, "short", 1e3, "mm swung back short of it", "1f"))
    found.append(_range(flight, "rms", 1e3, "mm rms at rest", "1f"))
    found.append(_range(flight, "doubt", 1e3, "mm from the depth in steps of 10 mm", "1f"))
    return "; ".join(found)


def table(flight: Flight) -> str:
    """Random releases: median, nine of ten within, and worst of each figure."""
    heave, turns = flight.releases, flight.turns
    rows = [
        ("heave let go: beyond the rest [mm]", [1e3 * r.bounce for r in heave]),
        ("heave let go: swung back [mm]", [1e3 * r.short for r in heave]),
        ("surge let go: depth off [mm]", [1e3 * off for off in flight.swayed]),
        ("turn let go: beyond the rest [mrad]", [1e3 * r.bounce for r in turns]),
        ("turn let go: swung back [mrad]", [1e3 * r.short for r in turns]),
        ("turn let go: speed [mrad/s]", [1e3 * r.speed for r in turns]),
    ]
    lines = [f"{flight.name}, {len(heave)} of heave, {len(flight.swayed)} of surge, {len(turns)}"]
    for words, found in rows:
        low, high, most = np.quantile(found, (0.5, 0.9, 1.0))
        each = ", ".join(f"{one:.1f}" for one in found)
        lines.append(f"{words}: {low:.1f} / {high:.1f} / {most:.1f} ({each})")
    return "\n".join(lines)


def _range(flight: Flight, what: str, unit: float, words: str, digits: str) -> str:
    numbers = [unit * getattr(release, what) for release in flight.releases]
    least, most, middle = min(numbers), max(numbers), median(numbers)
    return f"{least:.{digits}} to {most:.{digits}}, median {middle:.{digits}} {words}"


def _split(panel: Axes) -> list[Axes]:
    """Four panels in the place of one."""
    figure, place = panel.figure, panel.get_subplotspec()
    assert place is not None
    panel.remove()
    parts = place.subgridspec(1, 4, width_ratios=(1.8, 1.0, 1.0, 1.0))
    return [figure.add_subplot(parts[0, n]) for n in range(4)]


def _dives(panel: Axes, flights: Sequence[Flight]) -> None:
    for flight in flights:
        first = flight.truth.t[int(np.argmax(flight.truth.depth > 0.5))]
        shown = flight.truth.t > first - 2.0
        panel.plot(
            flight.truth.t[shown] - first,
            flight.truth.depth[shown],
            color=COLOURS[flight.name],
            label=flight.name,
        )
    panel.invert_yaxis()
    panel.set_xlabel("time since 0.5 m deep [s]")
    panel.set_ylabel("depth [m]")
    panel.legend(loc="lower right")


def _releases(panel: Axes, flights: Sequence[Flight]) -> None:
    for flight in flights:
        for number, release in enumerate(flight.releases):
            panel.plot(
                release.t,
                1e3 * release.travelled,
                color=COLOURS[flight.name],
                linewidth=1.0,
                linestyle="-" if release.sinking else ":",
                label=flight.name if number == 0 else None,
            )
    panel.set_xlabel("time since the stick was centred [s]")
    panel.set_ylabel("travelled [mm]")
    panel.legend(loc="lower right")


def _figures(panel: Axes, flights: Sequence[Flight], label: str, what: str) -> None:
    for place, flight in enumerate(flights):
        colour = COLOURS[flight.name]
        numbers = [1e3 * float(getattr(release, what)) for release in flight.releases]
        for n, (number, release) in enumerate(zip(numbers, flight.releases, strict=True)):
            panel.plot(
                place - 0.14 + 0.04 * n,
                number,
                marker="o",
                color=colour,
                fillstyle="full" if release.sinking else "none",
            )
        panel.hlines(median(numbers), place - 0.3, place + 0.3, color=colour)
    panel.set_xticks(range(len(flights)), [flight.name for flight in flights])
    panel.set_xlim(-0.6, len(flights) - 0.4)
    panel.set_ylim(bottom=0.0)
    panel.set_ylabel(label)
