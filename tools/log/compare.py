"""`lindy log compare`: two recordings side by side."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec
import numpy as np
from cyclopts import Parameter

from messages import topics
from messages.text import harmless
from messages.topic import AnyTopic
from services.runtime.config.errors import LindyError
from tools.analysis.dive import read_dive
from tools.choices import Json, NewPicture
from tools.exit_status import DONE, ERROR, LOST
from tools.fresh import require_picture, write_fresh
from tools.log.series import (
    Array,
    Differences,
    DiveSeries,
    FieldDifference,
    Words,
    differences,
    zeros,
)
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording
from tools.report import report_on
from tools.report.report import Extras
from tools.report.summary import is_loss
from tools.text_table import aligned

SHOWN = 20  # fields on the screen; all of them are in the JSON
ROUNDED = 1e-9  # [-] of a figure: no difference
SIZE = (10.0, 9.0)  # [in] of the picture
STYLES = ("-", "--")  # of A and of B, which may lie upon each other


class Panel(NamedTuple):
    """Of the picture."""

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


class ComparedFigure(msgspec.Struct):
    name: str
    unit: str
    a: float | None  # None: not measurable on that dive
    b: float | None


def compare(
    a: Path,
    b: Path,
    *,
    tolerance: Annotated[
        float, Parameter(help="[-] of the largest value of a field: what counts as the same")
    ] = 0.0,
    out: NewPicture = None,
    json: Json = False,
) -> int:
    """What differs between two recordings, when first.

    And by how much, by stream and field. A and B are dives' folders or MCAP files, of one vehicle.
    Times are seconds since arming, or, where one was never armed, since the recording began. Exit
    status 1: they differ; 3: one is damaged or was not finished.

    Example: lindy log compare dives/before dives/after --out compared.png
    """
    if not tolerance >= 0.0:
        raise LindyError(f"--tolerance is {tolerance:g}, expected 0 or more")
    if out is not None:
        require_picture(out, "--out")
    left, right = open_recording(a), open_recording(b)
    _require_one_vehicle(left, right)
    with reading("comparing", left.size + right.size) as advance:
        words = Words()
        left.advance = advance
        series_a = DiveSeries(left, words)
        right.advance = lambda at: advance(left.size + at)
        series_b = DiveSeries(right, words)
    damage = list[str]()
    for path, recording, series in ((a, left, series_a), (b, right, series_b)):
        if not series.topics:
            raise recording.empty(path)
        damage += [f"{path}: {said}" for said in [*recording.damage, *series.unreadable]]
    found, side_by_side = differences(series_a, series_b, tolerance), figures(left, right)
    if out is not None:
        write_fresh(out, drawn(series_a, series_b, (str(a), str(b))))
    if json:
        whole = {
            "same": found.none,
            "zero": "arming" if zeros(series_a, series_b)[0] == series_a.armed_ns else "beginning",
            "damage": damage,
            "figures": msgspec.to_builtins(side_by_side),
            **msgspec.to_builtins(found),
        }
        print(msgspec.json.format(msgspec.json.encode(whole)).decode())
    else:
        print(harmless(as_text(found, side_by_side)))
        if out is not None:
            print(f"written {out}")
        print(harmless("".join(f"{said}\n" for said in damage)), end="")
    if damage:
        return LOST
    return DONE if found.none else ERROR


def _require_one_vehicle(a: Recording, b: Recording) -> None:
    names = [recording.metadata("dive").get("vehicle", "") for recording in (a, b)]
    if names[0] != names[1]:
        raise LindyError(
            f"{a.files[0]} is of the vehicle {names[0] or 'unknown'}, {b.files[0]} of "
            f"{names[1] or 'unknown'}: compare two dives of one vehicle"
        )


def figures(a: Recording, b: Recording) -> list[ComparedFigure]:
    """Side by side."""
    return [
        ComparedFigure(name, unit, left, right)
        for (name, unit, left), (_, _, right) in zip(_figures(a), _figures(b), strict=True)
    ]


def _figures(recording: Recording) -> list[tuple[str, str, float | None]]:
    """Name, unit, value."""
    dive = read_dive(recording)
    report = report_on(dive, Extras())
    stick = report.latency_ms.stick_to_thruster
    stops = [stop.overshoot for stop in report.stops if stop.axis == "heave"]
    lost = sum(count for name, count in report.losses.items() if is_loss(name))
    return [
        ("length", "s", report.seconds),
        ("armed", "s", report.armed_seconds),
        ("deepest", "m", dive.max_depth_m),
        ("depth error, rms", "m", report.depth_error_rms_m),
        ("heading error, rms", "°", report.heading_error_rms_deg),
        ("worst depth stop", "m", max(stops, default=None)),
        ("jerk over its limit, peak", "-", report.peak_jerk_ratio),
        ("stick to thruster, median", "ms", stick.p50),
        ("stick to thruster, 99 %", "ms", stick.p99),
        ("energy", "Wh", report.energy.wh),
        ("thrust squared", "N² s", report.energy.thrust_squared_n2s),
        ("failsafes", "", float(len(report.failsafes))),
        ("losses of all kinds", "", float(lost)),
    ]


def as_text(found: Differences, side_by_side: list[ComparedFigure]) -> str:
    """Figures, topics with other numbers of messages, then the fields that differ."""
    rows = [
        [
            each.name,
            each.unit,
            _number(each.a),
            _number(each.b),
            "" if each.a is None or each.b is None else _number(_apart(each.a, each.b)),
        ]
        for each in side_by_side
    ]
    blocks = ["\n".join(aligned([["", "", "A", "B", "B - A"], *rows], left=2))]
    if found.none:
        same = "all fields of all messages are the same; their stamps and numbers are not compared"
        return f"{blocks[0]}\n\n{same}"
    if found.counts:
        counts = [[each.topic, str(each.a), str(each.b)] for each in found.counts]
        blocks.append("\n".join(aligned([["messages of", "A", "B"], *counts])))
    if found.fields:
        heads = ["topic", "field", "first [s]", "A", "B", "largest", "at [s]"]
        lines = aligned([heads, *map(_row, found.fields[:SHOWN])], left=2)
        if (more := len(found.fields) - SHOWN) > 0:
            lines.append(f"and {more} more fields; --json has all")
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


def _row(field: FieldDifference) -> list[str]:
    values = [value if isinstance(value, str) else _number(value) for value in (field.a, field.b)]
    numbers = _number(field.largest), _number(field.largest_s)
    return [field.topic, field.field, f"{field.first_s:.3f}", *(v[:24] for v in values), *numbers]


def _apart(a: float, b: float) -> float:
    """Without what rounding makes of sums."""
    return 0.0 if abs(b - a) <= ROUNDED * max(abs(a), abs(b)) else b - a


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def drawn(a: DiveSeries, b: DiveSeries, names: Sequence[str]) -> bytes:
    """A PNG: depth, heading and power over time, and how far the depths differ."""
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
