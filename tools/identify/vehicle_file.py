"""The vehicle file of a recording, and the same file with other numbers in it."""

import re
from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
from msgspec.structs import replace

from messages.payload import UNDECODABLE
from services.estimation.settings import Settings as EstimationSettings
from services.marine.vehicle import Vehicle
from services.marine.water import Density
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import convert, deploy_file, override, parsed_toml, read_text
from services.simulator.settings import Settings as SimulatorSettings
from tools.recordings.dive_file import vehicle_attached
from tools.recordings.recording import Recording

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
