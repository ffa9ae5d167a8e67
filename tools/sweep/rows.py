"""One dive of a sweep as a row of a table: the values of the axes, and the report's figures."""

import csv
import io
import json
import math
import os
import tomllib
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import degrees
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from messages import events
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.os import system
from tools.analysis.stops import StopAxis
from tools.fresh import write_fresh
from tools.report.report import Report
from tools.sweep.axes import PlannedDive

Cell = str | int | float | None
Row = dict[str, Cell]  # by column
CLEAN = "clean"


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


def columns(settings: list[str]) -> list[str]:
    """Names of all columns."""
    axes = ("dive", "vehicle", "link", "pilot", "seed", *settings)
    return [*axes, *FIGURES, "wall_s", "end"]


def row_of(dive: PlannedDive, flown: Flown | None, end: str, wall_s: float) -> Row:
    """
    Args:
        flown: None: there is no report, and `end` says why.
        end: `clean`, or the sentence with which the dive ended.
        wall_s: [s] that the dive took.
    """
    vehicle, link, pilot, settings = dive.combination
    row: Row = {"dive": dive.number, "vehicle": vehicle, "link": link, "pilot": pilot}
    row |= {"seed": dive.seed, **dict(map(_setting, settings))}
    row |= {n: None if flown is None else _finite(of(flown)) for n, of in FIGURES.items()}
    return row | {"wall_s": round(wall_s, 3), "end": end}


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


def encoded(rows: Sequence[Row], settings: list[str]) -> bytes:
    """
    Args:
        settings: keys of the axes of --set.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, columns(settings), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def require_unedited(table: Path, rows: Sequence[Row], settings: list[str]) -> None:
    """
    Raises:
        LindyError: the table has a line that no sweep has written: somebody edited it.
    """
    ours = set(encoded(rows, settings).splitlines())
    if table.exists() and not ours.issuperset(table.read_bytes().splitlines()):
        raise LindyError(
            f"cannot write {table}: it is not as the sweep wrote it; move it, and the same "
            "command writes it anew"
        )


SUFFIX = ".rows.jsonl"
FORMAT = "lindy sweep"  # key of the first line; its value is the format's number

About = dict[str, Any]  # what a sweep is: JSON, one key for everything that may differ


def rows_file(table: Path) -> Path:
    return table.with_name(table.name + SUFFIX)


class FinishedDives:
    """The rows so far. Keep it open while the sweep goes on: it locks the file."""

    def __init__(self, table: Path, about: About) -> None:
        """Begin a sweep, or go on with one.

        Raises:
            LindyError: it cannot be written; it is of another sweep, or is not a sweep's; another
                program is at it; or there is a table and no rows of a sweep.
        """
        self._table = table
        self._path = rows_file(table)
        self.rows: dict[int, Row] = {}  # by the dive's number
        begun = self._path.exists()
        if table.exists() and not begun:
            raise LindyError(
                f"cannot write {table}: it exists already, and there is no {self._path.name} of a "
                "sweep to go on with; choose another --out"
            )
        try:
            table.parent.mkdir(parents=True, exist_ok=True)
            if not begun:
                write_fresh(self._path, _line({FORMAT: 1, **about}))
            lock = system.lock(self._path)
            if lock is None:
                raise LindyError(f"another lindy sweep is at work on {self._path}")
            self._lock = lock
            self._file = self._path.open("r+b")
        except OSError as error:
            raise LindyError(f"cannot write {self._path}: {reason(error)}") from None
        try:
            self._read(about)
        except LindyError:
            self.close()
            raise

    def add(self, row: Row) -> None:
        """
        Raises:
            LindyError: the row cannot be written; those before it are.
        """
        try:
            self._file.write(_line(row))
            self._file.flush()
        except OSError as error:
            raise LindyError(f"cannot write {self._path}: {reason(error)}") from None
        self._keep(row)

    def replace_table(self, data: bytes) -> None:
        """Write the table, whole or not at all, in the place of the one before.

        Raises:
            LindyError: it cannot be written; the one before stays, and so do the rows.
        """
        fresh = self._table.with_name(f".{self._table.name}-{os.getpid()}")
        try:
            fresh.write_bytes(data)
            fresh.replace(self._table)
        except OSError as error:
            raise LindyError(
                f"cannot write {self._table}: {reason(error)}; all finished dives are safe in "
                f"{self._path}, and the same command writes the table"
            ) from None
        finally:
            fresh.unlink(missing_ok=True)

    def close(self) -> None:
        with suppress(OSError):  # of a row that was not written, which was said
            self._file.close()
        self._lock.release()

    def _read(self, about: About) -> None:
        data = self._file.read()
        whole = data.rfind(b"\n") + 1
        first, *lines = data[:whole].split(b"\n")[:-1] or [b""]
        self._check(_parsed(first), about)
        self._file.seek(whole)
        self._file.truncate()  # what a killed program left of a row
        for number, line in enumerate(lines, 2):
            row = _parsed(line)
            if "dive" not in row:
                raise LindyError(f"{self._path}:{number}: this is not the row of a dive")
            self._keep(row)

    def _keep(self, row: Row) -> None:
        number = row["dive"]
        assert isinstance(number, int)
        self.rows[number] = row

    def _check(self, found: About, about: About) -> None:
        if FORMAT not in found:
            raise LindyError(f"{self._path} is not the file of a sweep; choose another --out")
        wanted = json.loads(json.dumps({FORMAT: 1, **about}))
        for key in {**wanted, **found}:
            here, there = wanted.get(key), found.get(key)
            if there != here:
                raise LindyError(
                    f"{self._path} is of another sweep: {key} is {_short(there)} there and "
                    f"{_short(here)} here; choose another --out"
                )


def _line(entry: Row | About) -> bytes:
    return json.dumps(entry, ensure_ascii=False, allow_nan=False).encode() + b"\n"


def _parsed(line: bytes) -> dict[str, Any]:
    """Empty where it is no object."""
    try:
        entry = json.loads(line)
    except ValueError:
        return {}
    return entry if isinstance(entry, dict) else {}  # pyright: ignore[reportUnknownVariableType]


def _short(value: object) -> str:
    if value is None:
        return "not given"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else text[:60] + "…"


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
        axes.margins(x=0.1, y=0.1)  # no dot is cut off
        axes.set_ylim(0.0, axes.get_ylim()[1])
        axes.grid(axis="y", alpha=0.3)
    panels[-1].set_xticks(range(len(groups)), [label or "all dives" for label in groups])
    panels[-1].set_xlabel(" · ".join(varied) or "one combination")
    figure.suptitle(f"{len(rows)} simulated dive{'s' * (len(rows) != 1)}")
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=110)
    return png.getvalue()
