"""What a calibration found: settings of a vehicle file, with their deviations."""

import tomllib
from collections.abc import Sequence
from typing import Any, NamedTuple

import msgspec

from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import convert
from tools.identify.vehicle_file import Numbers, read_vehicle, toml, with_lines

CALIBRATION_TABLE = "vehicle.calibration"


class CalibrationError(LindyError):
    """The samples do not tell what was asked for; the sentence says what is missing."""


class Setting(NamedTuple):
    """One line of a table."""

    key: str
    value: Numbers
    std: tuple[float, ...]  # 1σ of each number, in order; empty: not known
    unit: str
    about: str = ""
    table: str = CALIBRATION_TABLE

    @property
    def toml(self) -> str:
        """Without the comment."""
        return f"{self.key} = {toml(self.value, 6)}"

    @property
    def line(self) -> str:
        known = f" ± {', '.join(f'{std:.2g}' for std in self.std)}" if self.std else ""
        return f"{self.toml}  # [{self.unit}]{known}{': ' if self.about else ''}{self.about}"


class SensorFound(NamedTuple):
    """Of one sensor."""

    settings: tuple[Setting, ...]
    remarks: tuple[str, ...]  # sentences for the user


def table(settings: Sequence[Setting]) -> str:
    """As they stand in a vehicle file."""
    lines = list[str]()
    for name, those in _by_table(settings).items():
        lines += ["", f"[{name}]", *(setting.line for setting in those)]
    return "\n".join(lines[1:])


def with_settings(name: str, text: str, settings: Sequence[Setting], why: str) -> str:
    """The text of a vehicle file with these settings in it; all else stays as it is.

    Raises:
        LindyError: the file is laid out in a way that cannot be rewritten.
    """
    by_table = _by_table(settings)
    tree: dict[str, Any] = msgspec.to_builtins(read_vehicle(name, text))
    for heading, those in by_table.items():
        inner = tree
        for part in heading.split(".")[1:]:
            inner = inner[part]
        inner.update(tomllib.loads("\n".join(setting.toml for setting in those)))
    wanted = convert(tree, Vehicle, f"{name}: vehicle")
    lines = {
        (heading, 0): {setting.key: f"{setting.line}; {why}" for setting in those}
        for heading, those in by_table.items()
    }
    return with_lines(name, text, lines, wanted)


def _by_table(settings: Sequence[Setting]) -> dict[str, list[Setting]]:
    found = dict[str, list[Setting]]()
    for setting in settings:
        found.setdefault(setting.table, []).append(setting)
    return found
