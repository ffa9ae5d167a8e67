"""The vehicle file of a recording, the same file with other numbers in it, and what a fit found, in
words."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from math import exp, sqrt
from typing import Any, NamedTuple

import msgspec
from msgspec.structs import replace

from messages.payload import UNDECODABLE
from services.estimation.settings import Settings as EstimationSettings
from services.marine.hydrodynamics import system_inertia
from services.marine.vehicle import Vehicle
from services.marine.water import Density
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import convert, deploy_file, override, parsed_toml, read_text
from services.simulator.settings import Settings as SimulatorSettings
from tools.identify.fit import NOT_MOVED, Fit, drag_at
from tools.identify.motion_model import (
    AXES,
    BUOYANCY,
    LAG,
    ROWS,
    Beginning,
    inertia_of,
    linear_of,
    quadratic_of,
    vehicle_of,
)
from tools.recordings.dive_file import vehicle_attached
from tools.recordings.recording import Recording
from tools.text_table import aligned

HEADING = re.compile(r"\s*\[+\s*([\w.]+)\s*\]+")
SIXES = ("added_mass", "linear_damping", "quadratic_damping")
DIGITS = 4  # significant
Numbers = float | tuple[float, ...] | tuple[tuple[float, ...], ...]


class VehicleFile(NamedTuple):
    name: str
    text: str
    tree: dict[str, Any]  # with the dive's --set
    vehicle: Vehicle
    wake_share: float  # [-]
    water: Density


def of_recording(recording: Recording, chosen: str | None) -> VehicleFile:
    """The file that is in the recording, with the dive's `--set`; or the chosen one.

    Raises:
        LindyError: there is none in it, or it is wrong.
    """
    name, text = vehicle_in(recording, chosen)
    tree = _tree(name, text)
    try:
        settings = recording.metadata("dive").get("overrides", "[]") if chosen is None else "[]"
        override(tree, msgspec.json.decode(settings, type=list[str]))
    except UNDECODABLE as error:
        raise LindyError(f"{recording.files[0]}: its settings: {error}") from None
    where = f"{name}: estimation"
    return VehicleFile(
        name, text, tree,
        convert(tree.get("vehicle", {}), Vehicle, "vehicle"),
        convert(tree.get("simulator", {}), SimulatorSettings, "simulator").wake_share,
        convert(tree.get("estimation", {}), EstimationSettings, where).water_density,
    )  # fmt: skip


def vehicle_in(recording: Recording | None, chosen: str | None) -> tuple[str, str]:
    """Name and text of the chosen vehicle file, or of that in the recording.

    Raises:
        LindyError: there is none.
    """
    if chosen is not None or recording is None:
        path = deploy_file("vehicles", chosen or "")
        return path.name, read_text(path)
    return vehicle_attached(recording)


def read_vehicle(name: str, text: str) -> Vehicle:
    """
    Raises:
        LindyError: it is no vehicle file.
    """
    return convert(_tree(name, text).get("vehicle", {}), Vehicle, f"{name}: vehicle")


def _tree(name: str, text: str) -> dict[str, Any]:
    try:
        return parsed_toml(text)
    except ValueError as error:
        raise LindyError(f"{name}: not valid TOML: {error}") from None


def with_lines(
    name: str, text: str, tables: Mapping[tuple[str, int], Mapping[str, str]], wanted: Vehicle
) -> str:
    """A vehicle file's text with these lines in it; all else stays as it is.

    Args:
        tables: name of a table, and its number among those of this name → key → whole line.
        wanted: what the new text then says.

    Raises:
        LindyError: the file is laid out in a way that cannot be rewritten.
    """
    blocks: list[list[str]] = [[]]  # each begins with a heading, but for the first
    for line in text.splitlines():
        if HEADING.match(line):
            blocks.append([])
        blocks[-1].append(line)
    left, counts = dict(tables), Counter[str]()
    for block in blocks:
        if not (block and (heading := HEADING.match(block[0]))):
            continue
        lines = left.pop((heading[1], counts[heading[1]]), {})
        counts[heading[1]] += 1
        keys = [line.partition("=")[0].strip() for line in block]
        block[:] = [lines.get(key, line) for key, line in zip(keys, block, strict=True)]
        block[1:1] = [line for key, line in lines.items() if key not in keys]
    blocks += [["", f"[{table}]", *lines.values()] for (table, _), lines in left.items()]
    new = "\n".join(line for block in blocks for line in block) + "\n"
    try:
        found = rounded(read_vehicle(name, new))
    except LindyError:
        found = None
    if found != rounded(wanted):
        raise LindyError(
            f"{name}: its [{'] or ['.join(dict.fromkeys(table for table, _ in tables))}] cannot be "
            f"rewritten, because it stands on several lines or in a table of another form; enter "
            f"the numbers above by hand"
        )
    return new


def rounded(vehicle: Vehicle) -> Vehicle:
    """With as many digits as are written; added mass and drag not below zero."""
    found: dict[str, Any] = {
        key: tuple(_digits(max(0.0, value)) for value in getattr(vehicle, key)) for key in SIXES
    }
    found["net_buoyancy"] = _digits(vehicle.net_buoyancy)
    found["thruster"] = [
        replace(thruster, time_constant=_digits(thruster.time_constant))
        for thruster in vehicle.thruster
    ]
    return replace(vehicle, **found)


def rewritten(file: VehicleFile, wanted: Vehicle, why: str) -> str:
    """The file's text with the numbers of `wanted`, and where they come from behind each. All else
    stays as it is.

    Raises:
        LindyError: the file is laid out in a way that cannot be rewritten.
    """
    before = rounded(read_vehicle(file.name, file.text))
    values = {
        key: toml(getattr(wanted, key), DIGITS)
        for key in SIXES
        if getattr(wanted, key) != getattr(before, key)
    }
    if wanted.net_buoyancy != before.net_buoyancy:
        values["net_buoyancy"] = toml(wanted.net_buoyancy, DIGITS)
    tables = {("vehicle", 0): {key: f"{key} = {value}  # {why}" for key, value in values.items()}}
    for number, (old, new) in enumerate(zip(before.thruster, wanted.thruster, strict=True)):
        if new.time_constant != old.time_constant:
            line = f"time_constant = {toml(new.time_constant, DIGITS)}  # [s] {why}"
            tables["vehicle.thruster", number] = {"time_constant": line}
    return with_lines(file.name, file.text, tables, wanted)


def _digits(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def toml(value: Numbers, digits: int) -> str:
    """As TOML writes floats, with so many significant digits."""
    if isinstance(value, tuple):
        return f"[{', '.join(toml(each, digits) for each in value)}]"
    text = f"{value:.{digits}g}"
    return text if any(c in text for c in ".en") else f"{text}.0"


NOT_WHITE = 1.5  # [-] enlargement of deviations that is worth a remark
SURE = 1.96  # [-] deviations to each side: 95 % of a normal distribution
ASSUMED = (
    "thrust is what the vehicle file makes of the commands: if it is 5 % more, so are all the "
    "numbers but the lag"
)


class ResultRow(NamedTuple):
    name: str
    unit: str
    value: float
    std: float
    file: float  # of the vehicle file


def rows(found: Fit, start: Beginning) -> Iterator[ResultRow]:
    """Only what was fitted."""
    std = [sqrt(max(0.0, v)) for v in found.covariance.diagonal().tolist()]
    file = start.vehicle
    for name in found.axes:
        axis = AXES.index(name)
        row, turns = ROWS[axis], name == "yaw"
        m, d, q = inertia_of(axis), linear_of(axis), quadratic_of(axis)
        mass, force, per = ("kg m²", "N m", "rad") if turns else ("kg", "N", "m")
        value = exp(found.x[m])
        inertia = system_inertia(file)[row]
        yield ResultRow(f"{name} inertia", mass, value, value * std[m], inertia)
        for label, unit, index, scale, own in (
            ("linear", f"{force} s/{per}", d, start.linear[axis], file.linear_damping),
            ("quadratic", f"{force} s²/{per}²", q, start.quadratic[axis], file.quadratic_damping),
        ):
            drag, deviation = found.x[index] * scale, std[index] * scale
            yield ResultRow(f"{name} {label} drag", unit, drag, deviation, own[row])
        speed = float(found.speed[axis])
        drag, deviation = drag_at(start, found.x, found.covariance, axis, speed)
        own, _ = drag_at(start, start.vector, found.covariance, axis, speed)
        yield ResultRow(f"{name} drag at {speed:.2g} {per}/s", force, drag, deviation, own)
    if "heave" in found.axes:
        yield ResultRow(
            "net buoyancy", "N", float(found.x[BUOYANCY]), std[BUOYANCY], file.net_buoyancy
        )
    if found.lag:
        lag = exp(found.x[LAG])
        yield ResultRow("thruster lag", "s", lag, lag * std[LAG], exp(start.vector[LAG]))


def identified(found: Fit, start: Beginning) -> Vehicle:
    """The vehicle file's vehicle with the fitted numbers. Added mass may be negative."""
    vehicle = vehicle_of(start, found.x, found.axes)
    if not found.lag:
        return vehicle
    lag = exp(found.x[LAG])
    return replace(
        vehicle, thruster=[replace(thruster, time_constant=lag) for thruster in vehicle.thruster]
    )


def remarks(found: Fit, vehicle: Vehicle) -> Iterator[str]:
    """What to know about the numbers, a sentence each."""
    yield ASSUMED
    for name, (inertia, drag) in found.refused.items():
        if name == "lag":
            yield f"thruster lag: kept as in the file; told to within {100 * inertia:.0f} % only"
        else:
            yield f"{name}: kept as in the file; {weakly(inertia, drag)}"
    if found.inflation.max() > NOT_WHITE:
        yield (
            f"the residuals are not white (deviations enlarged up to {found.inflation.max():.1f} "
            "times): something moved the vehicle that the model does not have, or the fit ended in "
            "a local optimum; fly once more and compare"
        )
    if found.unexplained:
        yield (
            f"{found.unexplained} windows left out, in which something else than the thrusters "
            "moved the vehicle"
        )
    for name in found.axes:
        row = ROWS[AXES.index(name)]
        if vehicle.added_mass[row] < 0.0:
            yield (
                f"{name}: the inertia is less than that of the dry vehicle in the file; check mass "
                "and thrust; the added mass is written as 0"
            )


def weakly(inertia: float, drag: float) -> str:
    """Why an axis is not fitted."""
    if (inertia, drag) == NOT_MOVED:
        return "the dive hardly moves along it"
    return (
        f"the dive tells its inertia to ± {100 * inertia:.0f} %, its drag to ± {100 * drag:.0f} %"
    )


def as_table(every: Iterable[ResultRow]) -> list[str]:
    """Value, standard deviation, file."""
    cells = [("", "", "value", "± std", "file")]
    cells += [
        (row.name, row.unit, f"{row.value:.4g}", f"{row.std:.2g}", f"{row.file:.4g}")
        for row in every
    ]
    return aligned(cells, left=2)
