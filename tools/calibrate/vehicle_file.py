"""The tables for a vehicle file, and the file with them in it."""

import re
import tomllib
from collections.abc import Sequence
from typing import Any

import msgspec

from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import convert, deploy_file, parsed_toml, read_text
from tools.calibrate.results import Setting
from tools.recordings.dive_file import vehicle_attached
from tools.recordings.recording import Recording

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
    wanted = _wanted(name, text, settings)
    new = text
    for heading, those in _by_table(settings).items():
        new = _with_table(new, heading, those, why)
    try:
        is_so = read_vehicle(name, new) == wanted
    except LindyError:
        is_so = False
    if not is_so:
        raise LindyError(
            f"{name}: its [{' or ['.join(f'{key}]' for key in _by_table(settings))} cannot be "
            f"rewritten, because it stands on several lines or in a table of another form; enter "
            f"the lines above by hand"
        )
    return new


def _by_table(settings: Sequence[Setting]) -> dict[str, list[Setting]]:
    found = dict[str, list[Setting]]()
    for setting in settings:
        found.setdefault(setting.table, []).append(setting)
    return found


def _with_table(text: str, name: str, settings: Sequence[Setting], why: str) -> str:
    keys = {setting.key for setting in settings}
    entered = [f"{setting.line}; {why}" for setting in settings]
    lines, inside, found = list[str](), False, False
    for line in text.splitlines():
        if heading := HEADING.match(line):
            inside = heading[1] == name
            lines.append(line)
            if inside:
                found = True
                lines += entered
        elif not (inside and line.partition("=")[0].strip() in keys):
            lines.append(line)
    if not found:
        lines += ["", f"[{name}]", *entered]
    return "\n".join(lines) + "\n"


def _wanted(name: str, text: str, settings: Sequence[Setting]) -> Vehicle:
    tree: dict[str, Any] = msgspec.to_builtins(read_vehicle(name, text))
    for heading, those in _by_table(settings).items():
        inner = tree
        for part in heading.split(".")[1:]:
            inner = inner[part]
        inner.update(tomllib.loads("\n".join(setting.toml for setting in those)))
    return convert(tree, Vehicle, f"{name}: vehicle")


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
