"""The vehicle file of a recording, and the same file with fitted numbers in it."""

import re
import tomllib
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
    if chosen is not None:
        path = deploy_file("vehicles", chosen)
        return _parsed(path.name, read_text(path), [])
    name, text = vehicle_attached(recording)
    try:
        settings = recording.metadata("dive").get("overrides", "[]")
        overrides = msgspec.json.decode(settings, type=list[str])
    except UNDECODABLE as error:
        raise LindyError(f"{recording.files[0]}: its settings: {error}") from None
    return _parsed(name, text, overrides)


def _parsed(name: str, text: str, overrides: list[str]) -> VehicleFile:
    try:
        tree = parsed_toml(text)
    except ValueError as error:
        raise LindyError(f"{name}: not valid TOML: {error}") from None
    override(tree, overrides)
    where = f"{name}: estimation"
    return VehicleFile(
        name, text, tree,
        convert(tree.get("vehicle", {}), Vehicle, "vehicle"),
        convert(tree.get("simulator", {}), SimulatorSettings, "simulator").wake_share,
        convert(tree.get("estimation", {}), EstimationSettings, where).water_density,
    )  # fmt: skip


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
    before = rounded(convert(tomllib.loads(file.text)["vehicle"], Vehicle, "vehicle"))
    values = {
        key: f"[{', '.join(map(_plain, getattr(wanted, key)))}]"
        for key in SIXES
        if getattr(wanted, key) != getattr(before, key)
    }
    if wanted.net_buoyancy != before.net_buoyancy:
        values["net_buoyancy"] = _plain(wanted.net_buoyancy)
    lines, table, thruster = list[str](), "", -1
    for line in file.text.splitlines():
        if heading := HEADING.match(line):
            table = heading[1]
            thruster += table == "vehicle.thruster"
            lines.append(line)
            if table == "vehicle.thruster" and _changed(before, wanted, thruster):
                constant = _plain(wanted.thruster[thruster].time_constant)
                lines.append(f"time_constant = {constant}  # [s] {why}")
            continue
        key = line.partition("=")[0].strip()
        lags = table == "vehicle.thruster" and key == "time_constant"
        if table == "vehicle" and key in values and not line.lstrip().startswith("#"):
            lines.append(f"{key} = {values[key]}  # {why}")
        elif not (lags and _changed(before, wanted, thruster)):
            lines.append(line)
    text = "\n".join(lines) + "\n"
    try:
        found = rounded(convert(tomllib.loads(text)["vehicle"], Vehicle, "vehicle"))
    except (tomllib.TOMLDecodeError, LindyError):
        found = None
    if found != rounded(wanted):
        raise LindyError(
            f"{file.name}: its [vehicle] cannot be rewritten, because a number stands on several "
            "lines or in a table of another form; enter the numbers above by hand"
        )
    return text


def _changed(before: Vehicle, wanted: Vehicle, thruster: int) -> bool:
    return before.thruster[thruster].time_constant != wanted.thruster[thruster].time_constant


def _digits(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _plain(value: float) -> str:
    """As TOML writes a float."""
    text = f"{value:.{DIGITS}g}"
    return text if any(c in text for c in ".e") else f"{text}.0"
