"""The table [vehicle.calibration] for a vehicle file, and the file with it in it."""

import re
import tomllib
from collections.abc import Sequence

import msgspec

from services.marine.calibration import SensorCalibration
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import convert, deploy_file, parsed_toml, read_text
from tools.calibrate.results import Setting
from tools.recordings.dive_file import vehicle_attached
from tools.recordings.recording import Recording

TABLE = "vehicle.calibration"
HEADING = re.compile(r"\s*\[+\s*([\w.]+)\s*\]+")


def vehicle_in(recording: Recording | None, chosen: str | None) -> tuple[str, str]:
    """Name and text of the chosen vehicle file, or of that in the recording.

    Raises:
        LindyError: there is none.
    """
    if chosen is not None or recording is None:
        path = deploy_file("vehicles", chosen or "")
        return path.name, read_text(path)
    return vehicle_attached(recording)


def table(settings: Sequence[Setting]) -> str:
    """As it stands in a vehicle file."""
    return "\n".join([f"[{TABLE}]", *(setting.line for setting in settings)])


def with_settings(name: str, text: str, settings: Sequence[Setting], why: str) -> str:
    """The text of a vehicle file with these settings in it; all else stays as it is.

    Raises:
        LindyError: the file is laid out in a way that cannot be rewritten.
    """
    wanted = _wanted(name, text, settings)
    keys = {setting.key for setting in settings}
    lines, inside, found = list[str](), False, False
    for line in text.splitlines():
        if heading := HEADING.match(line):
            inside = heading[1] == TABLE
            lines.append(line)
            if inside:
                found = True
                lines += [f"{setting.line}; {why}" for setting in settings]
        elif not (inside and line.partition("=")[0].strip() in keys):
            lines.append(line)
    if not found:
        lines += ["", f"[{TABLE}]", *(f"{setting.line}; {why}" for setting in settings)]
    new = "\n".join(lines) + "\n"
    try:
        is_so = read_vehicle(name, new) == wanted
    except LindyError:
        is_so = False
    if not is_so:
        raise LindyError(
            f"{name}: its [{TABLE}] cannot be rewritten, because it stands on several lines or in "
            f"a table of another form; enter the lines above by hand"
        )
    return new


def _wanted(name: str, text: str, settings: Sequence[Setting]) -> Vehicle:
    before = read_vehicle(name, text)
    given = tomllib.loads("\n".join(setting.toml for setting in settings))
    kept = msgspec.to_builtins(before.calibration)
    calibration = convert({**kept, **given}, SensorCalibration, TABLE)
    return msgspec.structs.replace(before, calibration=calibration)


def read_vehicle(name: str, text: str) -> Vehicle:
    """
    Raises:
        LindyError: it is no vehicle file.
    """
    try:
        tree = parsed_toml(text)
    except ValueError as error:
        raise LindyError(f"{name}: {error}") from None
    return convert(tree.get("vehicle", {}), Vehicle, f"{name}: vehicle")
