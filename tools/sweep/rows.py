"""One dive of a sweep as a row of a table: the values of the axes, and the report's figures. The
table is CSV or Parquet."""

import csv
import io
import json
import math
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from math import degrees
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from messages import events
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.analysis.stops import StopAxis
from tools.report import Report
from tools.sweep.axes import PlannedDive

Cell = str | int | float | None
Row = dict[str, Cell]  # by column
Kind = Literal["number", "whole", "text"]
CLEAN = "clean"
SUFFIXES = (".csv", ".parquet")


class Flown(NamedTuple):
    """What came of a dive."""

    report: Report
    deepest_m: float | None  # [m]


@dataclass(frozen=True, slots=True)
class Column:
    """A figure of a report. None: not measurable on this dive."""

    name: str  # with its unit
    kind: Kind
    value: Callable[[Flown], Cell]


def _stops(axis: StopAxis, name: str, unit: Literal["m", "deg"]) -> list[Column]:
    """How many stops there were, and by how much they ran too far, at three percentiles."""

    def past(flown: Flown) -> list[float]:
        return [stop.overshoot for stop in flown.report.stops if stop.axis == axis]

    def column(word: str, share: float) -> Column:
        def value(flown: Flown) -> float | None:
            if not (found := past(flown)):
                return None
            over = float(np.percentile(found, share))
            return degrees(over) if unit == "deg" else over

        return Column(f"{name}_overshoot_{word}_{unit}", "number", value)

    count = Column(f"{name}_stops", "whole", lambda flown: len(past(flown)))
    return [count, column("p50", 50), column("p95", 95), column("max", 100)]


def _failsafes(flown: Flown) -> int:
    losses = flown.report.losses
    return sum(n for name, n in losses.items() if events.row_of(name).severity is events.FAILSAFE)


FIGURES: tuple[Column, ...] = (
    Column("seconds", "number", lambda f: f.report.seconds),
    Column("deepest_m", "number", lambda f: f.deepest_m),
    *_stops("heave", "depth", "m"),
    *_stops("yaw", "turn", "deg"),
    Column("depth_error_rms_m", "number", lambda f: f.report.depth_error_rms_m),
    Column("heading_error_rms_deg", "number", lambda f: f.report.heading_error_rms_deg),
    Column("peak_jerk_ratio", "number", lambda f: f.report.peak_jerk_ratio),
    Column(
        "stick_to_thruster_p50_ms", "number", lambda f: f.report.latency_ms.stick_to_thruster.p50
    ),
    Column(
        "stick_to_thruster_p99_ms", "number", lambda f: f.report.latency_ms.stick_to_thruster.p99
    ),
    Column("energy_wh", "number", lambda f: f.report.energy.wh),
    Column("thrust_squared_n2s", "number", lambda f: f.report.energy.thrust_squared_n2s),
    Column("failsafes", "whole", _failsafes),
    Column("losses", "text", lambda f: json.dumps(f.report.losses)),
    Column("log_hash", "text", lambda f: f.report.log_hash or None),
)
AXES: dict[str, Kind] = {
    "dive": "whole", "vehicle": "text", "link": "text", "pilot": "text", "seed": "whole",
}  # fmt: skip
OWN: dict[str, Kind] = {"wall_s": "number", "end": "text", "folder": "text"}


def columns(settings: list[str]) -> dict[str, Kind | None]:
    """Name → kind of every column; None: a setting, of which the kind is that of its values."""
    kinds: dict[str, Kind | None] = {**AXES, **dict.fromkeys(settings)}
    kinds.update({figure.name: figure.kind for figure in FIGURES})
    kinds.update(OWN)
    return kinds


def row_of(dive: PlannedDive, flown: Flown | None, end: str, wall_s: float, folder: str) -> Row:
    """
    Args:
        flown: None: there is no report, and `end` says why.
        end: `clean`, or the sentence with which the dive ended.
        wall_s: [s] that the dive took.
        folder: with its files; empty: none.
    """
    vehicle, link, pilot, settings = dive.combination
    row: Row = {"dive": dive.number, "vehicle": vehicle, "link": link, "pilot": pilot}
    row |= {"seed": dive.seed, **dict(map(_setting, settings))}
    for figure in FIGURES:
        row[figure.name] = None if flown is None else _finite(figure.value(flown))
    return row | {"wall_s": round(wall_s, 3), "end": end, "folder": folder or None}


def _setting(assignment: str) -> tuple[str, Cell]:
    """Key and value; a number as a number, all else as it was written."""
    key, _, text = assignment.partition("=")
    try:
        value = tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        return key, text
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return key, _finite(value) if is_number else text


def _finite(cell: Cell) -> Cell:
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell


def check_table(out: Path) -> None:
    """
    Raises:
        LindyError: this kind of table cannot be written here.
    """
    if out.suffix not in SUFFIXES:
        raise LindyError(f"--out {out}: expected a name that ends in {' or '.join(SUFFIXES)}")
    if out.suffix == ".parquet" and find_spec("pyarrow") is None:
        raise LindyError(
            f"--out {out} needs pyarrow, which is not installed; {how_to_install('tables')}; "
            "a table .csv needs nothing"
        )


def encoded(rows: Sequence[Row], settings: list[str], suffix: str) -> bytes:
    """
    Args:
        settings: keys of the axes of --set.
    """
    return _parquet(rows, settings) if suffix == ".parquet" else _csv(rows, settings)


def _csv(rows: Sequence[Row], settings: list[str]) -> bytes:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(columns(settings)), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def _parquet(rows: Sequence[Row], settings: list[str]) -> bytes:
    pyarrow: Any = import_module("pyarrow")  # it has no types
    parquet: Any = import_module("pyarrow.parquet")
    kinds = {"number": pyarrow.float64(), "whole": pyarrow.int64(), "text": pyarrow.string()}
    arrays: dict[str, Any] = {}
    for name, kind in columns(settings).items():
        cells = [row.get(name) for row in rows]
        if kind is None:
            kind = "number" if all(map(_is_number, cells)) else "text"
            cells = cells if kind == "number" else [None if c is None else str(c) for c in cells]
        arrays[name] = pyarrow.array(cells, kinds[kind])
    buffer = pyarrow.BufferOutputStream()
    parquet.write_table(pyarrow.table(arrays), buffer)
    return buffer.getvalue().to_pybytes()


def _is_number(cell: Cell) -> bool:
    return isinstance(cell, int | float)
