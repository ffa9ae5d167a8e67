"""What a recording carries besides its messages: every file that the dive was started with, and
`dive.json`, which says what each of them was for. `lindy simulate --from` needs nothing else.
"""

import hashlib
import json
import platform
from collections.abc import Iterable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from messages import topics
from messages.version import VERSION
from services.runtime.config.errors import LindyError
from services.runtime.config.identity import commit_here, messages_hash
from services.runtime.config.passwords import without_passwords
from services.runtime.config.settings import DEPLOY, deploy_file, kept
from services.runtime.config.stack import Stack

DIVE = "dive.json"
MEDIA_TYPES = {".toml": "application/toml", ".csv": "text/csv"}
ELSEWHERE = ("out", "viewer")  # of a `Stack`: where it was flown, not what


class AttachedFile(NamedTuple):
    name: str
    media_type: str
    data: bytes
    create_ns: int  # [ns] UTC when the file was written last; 0: unknown


def attachments(stack: Stack) -> list[AttachedFile]:
    """Of one dive: `dive.json` first, then the files as they are now.

    Raises:
        LindyError: there is no vehicle file.
    """
    found: list[AttachedFile] = []
    rows: list[dict[str, Any]] = []
    for path in _files(stack):
        try:
            data, written_ns = kept(path).read_bytes(), kept(path).stat().st_mtime_ns
        except OSError:  # it has gone since the dive began; the rest is worth having
            rows.append({**_where(path), "attachment": None})
            continue
        data = _publishable(data, path)
        name = _name(path, {each.name for each in found})
        sha256 = hashlib.sha256(data).hexdigest()
        rows.append({**_where(path), "attachment": name, "sha256": sha256})
        media_type = MEDIA_TYPES.get(path.suffix, "application/octet-stream")
        found.append(AttachedFile(name, media_type, data, written_ns))
    written_ns = max((each.create_ns for each in found), default=0)
    about = json.dumps(_about(stack, rows), indent=1).encode()
    return [AttachedFile(DIVE, "application/json", about, written_ns), *found]


def computer() -> dict[str, str]:
    """What the bits of a result may depend on besides Lindy."""
    try:
        numpy = version("numpy")
    except PackageNotFoundError:
        numpy = ""
    return {"python": platform.python_version(), "numpy": numpy, "machine": platform.machine()}


def lindy() -> dict[str, str]:
    """Which Lindy this is."""
    return {
        "version": VERSION,
        "commit": commit_here(),
        "messages": messages_hash(topics.ALL),
    }


def _about(stack: Stack, rows: list[dict[str, Any]]) -> dict[str, Any]:
    choices = msgspec.to_builtins(stack)
    choices["overrides"] = [*map(without_passwords, stack.overrides)]
    chosen = {name: value for name, value in choices.items() if name not in ELSEWHERE}
    return {"lindy": lindy(), "computer": computer(), "stack": chosen, "files": rows}


def _publishable(data: bytes, path: Path) -> bytes:
    """A file as it is attached: recordings are passed on."""
    if path.suffix != ".toml":
        return data
    with suppress(UnicodeDecodeError):
        return without_passwords(data.decode()).encode()
    return data


def _files(stack: Stack) -> Iterable[Path]:
    """Without one that is not there any more."""
    files = [*stack.files]
    with suppress(LindyError):
        files.append(deploy_file("stacks", stack.services))
    return dict.fromkeys(files)


def _where(path: Path) -> dict[str, Any]:
    """The path as it was named; of one of Lindy's own files that in the folder deploy, which is
    elsewhere on every computer."""
    shipped = path.is_relative_to(DEPLOY)
    return {
        "path": path.relative_to(DEPLOY).as_posix() if shipped else str(path),
        "shipped": shipped,
    }


def _name(path: Path, taken: set[str]) -> str:
    name, number = path.name, 2
    while name in taken:
        name, number = f"{path.stem}-{number}{path.suffix}", number + 1
    return name
