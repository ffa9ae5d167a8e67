"""What a calibration found: settings of a vehicle file, with their deviations."""

from typing import NamedTuple

from services.runtime.config.errors import LindyError

CALIBRATION_TABLE = "vehicle.calibration"


class CalibrationError(LindyError):
    """The samples do not tell what was asked for; the sentence says what is missing."""


class Setting(NamedTuple):
    """One line of a table."""

    key: str
    value: float | tuple[float, ...] | tuple[tuple[float, ...], ...]
    std: tuple[float, ...]  # 1σ of each number, in order; empty: not known
    unit: str
    about: str = ""
    table: str = CALIBRATION_TABLE

    @property
    def toml(self) -> str:
        """Without the comment."""
        return f"{self.key} = {_toml(self.value)}"

    @property
    def line(self) -> str:
        known = f" ± {', '.join(f'{std:.2g}' for std in self.std)}" if self.std else ""
        return f"{self.toml}  # [{self.unit}]{known}{': ' if self.about else ''}{self.about}"


class SensorFound(NamedTuple):
    """Of one sensor."""

    settings: tuple[Setting, ...]
    remarks: tuple[str, ...]  # sentences for the user


def _toml(value: float | tuple[float, ...] | tuple[tuple[float, ...], ...]) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    text = f"{value:.6g}"
    return text if any(c in text for c in ".en") else f"{text}.0"
