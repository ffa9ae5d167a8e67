"""The parts that a vehicle file names as its sensors: files of deploy/sensors, in which a part's
figures stand once for every vehicle that has it.

A part file has tables as a vehicle file has. They lie under those of the vehicle file, so that what
is stated there, or by `--set`, counts.
"""

from pathlib import Path
from typing import Any, cast

import msgspec

from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY, convert, deploy_file, nearest, read_toml

SENSORS = "sensors"  # the table of a vehicle file, and the folder in deploy/


class NamedSensors(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [sensors] of a vehicle file: names in deploy/sensors, or own part files."""

    imu: str | None = None
    magnetometer: str | None = None
    pressure: str | None = None
    dvl: str | None = None


class SensorPart(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part file; the keys of its tables are those of a vehicle file's."""

    kind: str  # a key of [sensors]
    simulator: dict[str, Any] = {}
    estimation: dict[str, Any] = {}


def with_parts(tree: dict[str, Any], paths: list[Path]) -> dict[str, Any]:
    """A vehicle file with the figures of its parts where it states none itself."""
    for path in paths:
        part = read_part(path)
        tree = _under(tree, {"simulator": part.simulator, "estimation": part.estimation})
    return tree


def read_part(path: Path) -> SensorPart:
    """
    Raises:
        LindyError: it cannot be read, or is no part file.
    """
    return convert(read_toml(path), SensorPart, "", path)


def part_path(kind: str, name: str) -> Path:
    """The file of a part that a vehicle file names as its sensor of this kind.

    Raises:
        LindyError: there is no such part, or it is a sensor of another kind.
    """
    try:
        path = deploy_file(SENSORS, name)
        found = read_part(path).kind
    except LindyError:
        if name.endswith(".toml") or "/" in name:
            raise
        raise LindyError(f"unknown part {name!r}{nearest(name, _known(kind))}") from None
    if found != kind:
        raise LindyError(f"{name!r} is of the kind {found!r}; known: {', '.join(_known(kind))}")
    return path


def _known(kind: str) -> list[str]:
    files = sorted((DEPLOY / SENSORS).glob("*.toml"))
    return [file.stem for file in files if read_part(file).kind == kind]


def _under(above: dict[str, Any], below: dict[str, Any]) -> dict[str, Any]:
    """Both, table by table; where both have a value, that of `above`."""
    together = {**below, **above}
    for name in above.keys() & below.keys():
        if isinstance(above[name], dict) and isinstance(below[name], dict):
            together[name] = _under(
                cast(dict[str, Any], above[name]), cast(dict[str, Any], below[name])
            )
    return together
