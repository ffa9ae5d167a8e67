"""One dive of a sweep as a row of a table: the values of the axes, and the report's figures. The
table is CSV or Parquet."""

import csv
import io
import json
import math
import tomllib
from collections.abc import Callable, Sequence
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
from tools.report.report import Report
from tools.sweep.axes import PlannedDive

Cell = str | int | float | None
Row = dict[str, Cell]  # by column
CLEAN = "clean"
SUFFIXES = (".csv", ".parquet")


class Flown(NamedTuple):
    """What came of a dive."""

    report: Report
    deepest_m: float | None  # [m]


Figure = Callable[[Flown], Cell]  # None: not measurable on this dive


def _stops(axis: StopAxis, name: str, unit: Literal["m", "deg"]) -> dict[str, Figure]:
    """How many stops there were, and by how much they ran too far, at three percentiles."""

    in_unit = degrees if unit == "deg" else float

    def past(flown: Flown) -> list[float]:
        return [stop.overshoot for stop in flown.report.stops if stop.axis == axis]

    def at(share: float) -> Figure:
        return lambda flown: (
            in_unit(float(np.percentile(found, share))) if (found := past(flown)) else None
        )

    shares = {"p50": 50.0, "p95": 95.0, "max": 100.0}
    over = {f"{name}_overshoot_{word}_{unit}": at(share) for word, share in shares.items()}
    return {f"{name}_stops": lambda flown: len(past(flown)), **over}


def _failsafes(flown: Flown) -> int:
    losses = flown.report.losses
    return sum(n for name, n in losses.items() if events.row_of(name).severity is events.FAILSAFE)


FIGURES: dict[str, Figure] = {  # of a report, by a name with its unit
    "seconds": lambda f: f.report.seconds,
    "deepest_m": lambda f: f.deepest_m,
    **_stops("heave", "depth", "m"),
    **_stops("yaw", "turn", "deg"),
    "depth_error_rms_m": lambda f: f.report.depth_error_rms_m,
    "heading_error_rms_deg": lambda f: f.report.heading_error_rms_deg,
    "peak_jerk_ratio": lambda f: f.report.peak_jerk_ratio,
    "stick_to_thruster_p50_ms": lambda f: f.report.latency_ms.stick_to_thruster.p50,
    "stick_to_thruster_p99_ms": lambda f: f.report.latency_ms.stick_to_thruster.p99,
    "energy_wh": lambda f: f.report.energy.wh,
    "thrust_squared_n2s": lambda f: f.report.energy.thrust_squared_n2s,
    "failsafes": _failsafes,
    "losses": lambda f: json.dumps(f.report.losses),
    "log_hash": lambda f: f.report.log_hash or None,
}
TEXTS = {"vehicle", "link", "pilot", "losses", "log_hash", "end", "folder"}
WHOLE = {"dive", "seed", "depth_stops", "turn_stops", "failsafes"}


def columns(settings: list[str]) -> list[str]:
    """Names of all columns."""
    axes = ("dive", "vehicle", "link", "pilot", "seed", *settings)
    return [*axes, *FIGURES, "wall_s", "end", "folder"]


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
    row |= {n: None if flown is None else _finite(of(flown)) for n, of in FIGURES.items()}
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
    if suffix == ".parquet":
        return _parquet(rows, settings)
    text = io.StringIO()
    writer = csv.DictWriter(text, columns(settings), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def _parquet(rows: Sequence[Row], settings: list[str]) -> bytes:
    """A setting is a number if all its values are."""
    pyarrow: Any = import_module("pyarrow")  # it has no types
    parquet: Any = import_module("pyarrow.parquet")
    arrays: dict[str, Any] = {}
    for name in columns(settings):
        cells = [row.get(name) for row in rows]
        if name in settings and not all(isinstance(cell, int | float) for cell in cells):
            arrays[name] = pyarrow.array([None if c is None else str(c) for c in cells])
            continue
        kind = pyarrow.int64() if name in WHOLE else pyarrow.float64()
        arrays[name] = pyarrow.array(cells, pyarrow.string() if name in TEXTS else kind)
    buffer = pyarrow.BufferOutputStream()
    parquet.write_table(pyarrow.table(arrays), buffer)
    return buffer.getvalue().to_pybytes()
