"""`docs/imports.svg`: the rooms of the code and who imports whom, as counted (`make docs`).

Left out is what is so everywhere: the imports of `messages`, and those of `services.runtime` by the
services. Tools point to the services as a whole.
"""

from collections import Counter
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import grimp
import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

OUT = Path("docs/imports.svg")
ROOTS = ("messages", "services", "tools")
EVERYBODYS = "messages"  # imports of it are not drawn, nor …
OF_SERVICES = ("services.runtime", "services")  # … those of the runtime by a service


class Box(NamedTuple):
    """A box on the page; lengths in columns and rows."""

    x: float  # of its middle
    y: float  # of its middle, upwards
    width: float = 0.92
    height: float = 0.62


SERVICES = Box(2.5, 3.05, 6.3, 3.1)  # the frame around all of them
BOXES = {
    "tools": Box(2.5, 5.15, 2.6),
    "services": SERVICES,
    "services.foxglove": Box(-0.220, 4.0, 0.66),
    "services.gamepad": Box(0.493, 4.0, 0.66),
    "services.cockpit": Box(1.185, 4.0, 0.62),
    "services.mavlink": Box(1.858, 4.0, 0.62),
    "services.ros2": Box(2.470, 4.0, 0.5),
    "services.tether": Box(3.032, 4.0, 0.52),
    "services.link_monitor": Box(3.725, 4.0, 0.76),
    "services.visualizer": Box(4.497, 4.0, 0.68),
    "services.predictor": Box(5.220, 4.0, 0.66),
    "services.recorder": Box(-0.14, 3.0, 0.82),
    "services.ardusub": Box(0.98, 3.0, 0.78),
    "services.simulator": Box(1.86, 3.0, 0.78),
    "services.estimation": Box(2.82, 3.0),
    "services.control": Box(3.86, 3.0),
    "services.reference": Box(5.12, 3.0),
    "services.camera": Box(-0.14, 2.5, 0.6, 0.3),
    "services.camera_monitor": Box(0.66, 2.5, 0.84, 0.3),
    "services.vehicle_view": Box(1.54, 2.5, 0.76, 0.3),
    "services.waterlinked": Box(2.34, 2.5, 0.72, 0.3),
    "services.ping": Box(3.0, 2.5, 0.46, 0.3),
    "services.nmea": Box(3.56, 2.5, 0.46, 0.3),
    "services.ugps": Box(4.12, 2.5, 0.46, 0.3),
    "services.instruments": Box(4.86, 2.5, 0.76, 0.3),
    "services.piloting": Box(-0.14, 2.0, 0.82),
    "services.mavlink_io": Box(0.86, 2.0, 0.82),
    "services.vehicle": Box(1.86, 2.0, 0.82),
    "services.marine": Box(3.2, 2.0, 1.2),
    "services.runtime": Box(5.0, 2.0),
    "messages": Box(2.5, 0.95, 6.3, 0.5),
}
LEFT, BOTTOM, WIDTH, HEIGHT = -0.8, 0.55, 6.6, 5.0  # [columns], [rows] of the page
COLUMN, ROW = 1.75, 1.35  # [in]
PAPER, FRAME, INK, LINE, UPWARD = "#ffffff", "#f6f8fb", "#1b2a41", "#7d93ad", "#b3261e"
FILL = "#e6edf5"
Arrows = Counter[tuple[str, str]]


def main() -> None:
    graph = grimp.build_graph(*ROOTS, cache_dir=None)
    OUT.write_bytes(rendered(graph, "svg"))


def rendered(graph: grimp.ImportGraph, kind: str) -> bytes:
    """The picture as a file of this kind. The same imports give the same bytes."""
    file = BytesIO()
    metadata = {"Date": None} if kind == "svg" else None
    with matplotlib.rc_context({"svg.hashsalt": "lindy", "svg.fonttype": "none"}):
        drawn(graph).savefig(file, format=kind, metadata=metadata, facecolor=PAPER)
    return file.getvalue()


def arrows_of(graph: grimp.ImportGraph) -> Arrows:
    """Imports between the boxes, by (importer, imported)."""
    arrows: Arrows = Counter()
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            source, target = box_of(module), box_of(imported)
            if source.startswith("tools") and target.startswith("services"):
                target = "services"
            if source != target and not _is_everywhere(source, target):
                arrows[source, target] += 1
    return arrows


def box_of(module: str) -> str:
    """The box a module is in: the longest name that is its own or its beginning."""
    inside = [name for name in BOXES if module == name or module.startswith(f"{name}.")]
    return max(inside, key=len)


def _is_everywhere(source: str, target: str) -> bool:
    """Is it a matter of course, or of a service with the frame it stands in?"""
    return target == EVERYBODYS or (source.startswith("services") and target in OF_SERVICES)


def drawn(graph: grimp.ImportGraph) -> Figure:
    figure = Figure(figsize=(COLUMN * WIDTH, ROW * HEIGHT))
    axes: Axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(LEFT, LEFT + WIDTH)
    axes.set_ylim(BOTTOM, BOTTOM + HEIGHT)
    axes.set_axis_off()
    _draw_frame(axes, SERVICES)
    for (source, target), count in sorted(arrows_of(graph).items()):
        _draw_arrow(axes, BOXES[source], BOXES[target], count)
    for name, box in BOXES.items():
        if name != "services":
            _draw_box(axes, name, box, rooms_of(graph, name))
    return figure


def rooms_of(graph: grimp.ImportGraph, name: str) -> list[str]:
    """Sub-packages, without those that have a box of their own."""
    children = [child for child in graph.find_children(name) if child not in BOXES]
    return sorted(child.rpartition(".")[2] for child in children if graph.find_children(child))


def _draw_frame(axes: Axes, box: Box) -> None:
    _rectangle(axes, box, FRAME, LINE)
    left, top = box.x - box.width / 2, box.y + box.height / 2
    axes.text(left + 0.08, top - 0.14, "services", color=INK, fontsize=13, fontweight="bold")


def _draw_box(axes: Axes, name: str, box: Box, rooms: list[str]) -> None:
    _rectangle(axes, box, FILL, INK)
    title = name.removeprefix("services.")
    lines = [" · ".join(rooms[k : k + 3]) for k in range(0, len(rooms), 3)]
    if box.width < 1.0:
        lines = [" · ".join(rooms[k : k + 2]) for k in range(0, len(rooms), 2)]
    up = 0.065 * len(lines)
    axes.text(
        box.x, box.y + up, title, ha="center", va="center", color=INK, fontsize=12,
        fontweight="bold", zorder=4,
    )  # fmt: skip
    for number, line in enumerate(lines, 1):
        axes.text(
            box.x, box.y + up - 0.135 * number - 0.01, line, ha="center", va="center", color=INK,
            fontsize=8.5, zorder=4,
        )  # fmt: skip


def _rectangle(axes: Axes, box: Box, fill: str, edge: str) -> None:
    corner = box.x - box.width / 2, box.y - box.height / 2
    style = "round,pad=0,rounding_size=0.06"
    axes.add_patch(
        FancyBboxPatch(
            corner, box.width, box.height, boxstyle=style, fc=fill, ec=edge, lw=1.2,
            zorder=3 if fill == FILL else 1,
        )
    )  # fmt: skip


def _draw_arrow(axes: Axes, source: Box, target: Box, count: int) -> None:
    """From edge to edge, with the number of imports on it; red where it goes upwards."""
    start, end = _ends(source, target)
    arrow = {"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0, "lw": 0.8 + 0.2 * count**0.5}
    arrow["color"] = LINE if target.y <= source.y else UPWARD
    axes.annotate("", xy=end, xytext=start, arrowprops=arrow, zorder=2)
    x, y = (0.7 * a + 0.3 * b for a, b in zip(start, end, strict=True))
    axes.text(
        x, y, str(count), ha="center", va="center", color=INK, fontsize=8, zorder=5,
        bbox={"boxstyle": "round,pad=0.15", "fc": FRAME, "ec": "none"},
    )  # fmt: skip


def _ends(source: Box, target: Box) -> tuple[tuple[float, float], tuple[float, float]]:
    if source.y == target.y:
        way = 1 if target.x > source.x else -1
        height = source.y + 0.1 * way  # so that two that import each other are seen apart
        start, end = source.x + way * source.width / 2, target.x - way * target.width / 2
        return (start, height), (end, height)
    way = 1 if target.y > source.y else -1
    room = 0.4 * min(source.width, target.width)
    shift = max(-room, min(room, 0.3 * (source.x - target.x)))  # arrows end beside each other
    x = source.x if target is SERVICES else target.x + shift
    return (source.x, source.y + way * source.height / 2), (x, target.y - way * target.height / 2)


if __name__ == "__main__":
    main()
