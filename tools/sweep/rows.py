"""One dive of a sweep as a row of a table: the values of the axes, and the report's figures."""

import json
import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from math import degrees
from typing import Literal, NamedTuple

import numpy as np

from messages import events
from tools.analysis.stops import StopAxis
from tools.report import Report
from tools.sweep.axes import PlannedDive

Cell = str | int | float | None
Row = dict[str, Cell]  # by column
Kind = Literal["number", "whole", "text"]
CLEAN = "clean"


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


def _past(axis: StopAxis, share: float) -> Callable[[Flown], Cell]:
    """[m] or [°] by which the stops ran too far, at this percentile."""

    def value(flown: Flown) -> float | None:
        past = [stop.overshoot for stop in flown.report.stops if stop.axis == axis]
        if not past:
            return None
        found = float(np.percentile(past, share))
        return found if axis == "heave" else degrees(found)

    return value


def _count(axis: StopAxis) -> Callable[[Flown], Cell]:
    return lambda flown: len([stop for stop in flown.report.stops if stop.axis == axis])


def _failsafes(flown: Flown) -> int:
    losses = flown.report.losses
    return sum(n for name, n in losses.items() if events.row_of(name).severity is events.FAILSAFE)


def _log_hash(flown: Flown) -> str | None:
    return flown.report.log_hash or None


FIGURES = (
    Column("seconds", "number", lambda f: f.report.seconds),
    Column("deepest_m", "number", lambda f: f.deepest_m),
    Column("depth_stops", "whole", _count("heave")),
    Column("depth_overshoot_p50_m", "number", _past("heave", 50)),
    Column("depth_overshoot_p95_m", "number", _past("heave", 95)),
    Column("depth_overshoot_max_m", "number", _past("heave", 100)),
    Column("turn_stops", "whole", _count("yaw")),
    Column("turn_overshoot_p50_deg", "number", _past("yaw", 50)),
    Column("turn_overshoot_p95_deg", "number", _past("yaw", 95)),
    Column("turn_overshoot_max_deg", "number", _past("yaw", 100)),
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
    Column("log_hash", "text", _log_hash),
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
