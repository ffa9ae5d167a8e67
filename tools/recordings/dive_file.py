"""The attachment `dive.json` of a recording: what was flown, by which Lindy, from which files."""

import hashlib
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import msgspec
from mcap.records import Attachment

from messages.payload import UNDECODABLE
from services.recorder.io.attachments import DIVE
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY, reading_copies
from services.runtime.config.stack import Stack
from tools.recordings.recording import Recording

S = TypeVar("S")


class UsedFile(msgspec.Struct, frozen=True):
    """A file that the dive was started with."""

    path: str  # as it was named
    shipped: bool = False  # it is one of Lindy's own: the path is in the folder deploy
    attachment: str | None = None  # name of its copy in the recording; None: it was gone
    sha256: str = ""


class FlownStack(msgspec.Struct, frozen=True):
    """The settings of the dive. A field that a later Lindy adds is ignored."""

    vehicle: str
    link: str
    pilot: str
    seed: int = 0
    overrides: list[str] = []
    services: str = "simulated"
    running: list[str] = []
    seconds: float | None = None
    virtual: bool = False
    apart: bool = False


class FlownDive(msgspec.Struct, frozen=True):
    lindy: dict[str, str]  # version, commit, hash of the messages
    computer: dict[str, str]  # what results may depend on besides
    stack: FlownStack
    files: list[UsedFile] = []

    def named(self, folder: str, name: str, suffix: str) -> UsedFile | None:
        """The file of a vehicle, a link, a script …, as `deploy_file` finds it."""
        own = name.endswith(suffix)
        wanted = (str(Path(name)), False) if own else (f"{folder}/{name}{suffix}", True)
        return next((file for file in self.files if (file.path, file.shipped) == wanted), None)

    def differences(self, lindy: dict[str, str], computer: dict[str, str]) -> list[str]:
        """What is not the same here, in words."""
        pairs: list[tuple[str, str, str]] = [
            (name, there.get(name, ""), value)
            for there, here in ((self.lindy, lindy), (self.computer, computer))
            for name, value in here.items()
        ]
        return [
            f"{name} {then or 'unknown'}, here {now or 'unknown'}"
            for name, then, now in pairs
            if then != now
        ]


def flown_dive(recording: Recording) -> FlownDive | None:
    """None: it carries no such attachment, as of an older Lindy or of another program.

    Raises:
        LindyError: the attachment cannot be read.
    """
    data = recording.attachment(DIVE)
    return None if data is None else _decoded(data, recording)


def flown_section(recording: Recording, name: str, kind: type[S]) -> S | None:
    """A table of the vehicle file that the dive was flown with, and what was set on top; None: the
    recording does not carry it.

    Raises:
        LindyError: what it carries is damaged.
    """
    dive = flown_dive(recording)
    if dive is None or dive.named("vehicles", dive.stack.vehicle, ".toml") is None:
        return None
    settings = [file for file in dive.files if file.path.endswith(".toml")]  # not scripts
    with TemporaryDirectory(prefix="lindy-") as folder:
        copies = unpacked(recording, settings, Path(folder))
        with reading_copies(copies):
            stack = Stack(vehicle=dive.stack.vehicle, overrides=dive.stack.overrides)
            return stack.section(name, kind)


def unpacked(recording: Recording, used: Sequence[UsedFile], folder: Path) -> dict[str, str]:
    """Copies of the files, by the path that each was read from.

    Raises:
        LindyError: one is not what it was when it was recorded, or was lost with a damaged part.
    """
    copies: dict[str, str] = {}
    wanted = {file.attachment: file for file in used if file.attachment is not None}
    for attachment in recording.attachments():
        if (file := wanted.pop(attachment.name, None)) is None:
            continue
        if file.sha256 and hashlib.sha256(attachment.data).hexdigest() != file.sha256:
            raise LindyError(f"{recording.files[0]}: the attached {file.path} is damaged")
        copy = folder / str(len(copies))
        copy.write_bytes(attachment.data)
        with suppress(OverflowError):  # of a damaged recording: no time at all
            os.utime(copy, ns=(attachment.create_time, attachment.create_time))
        path = DEPLOY / file.path if file.shipped else Path(file.path)
        copies[str(path)] = str(copy)
    for file in wanted.values():  # one of this computer by that name may be another one
        raise LindyError(f"{recording.files[0]}: the attached {file.path} is damaged, or left out")
    return copies


def vehicle_attached(recording: Recording) -> tuple[str, str]:
    """Name and text of the vehicle file that the dive was flown with.

    Raises:
        LindyError: the recording does not carry it, or it is damaged.
    """
    where, dive = recording.files[0], flown_dive(recording)
    used = dive and dive.named("vehicles", dive.stack.vehicle, ".toml")
    for record in recording.described():
        if isinstance(record, Attachment) and record.media_type == "application/toml":
            if used is not None and record.name != used.attachment:
                continue
            try:
                return record.name, record.data.decode()
            except UnicodeDecodeError as error:
                raise LindyError(f"{where}: {record.name}: {error}") from None
    if used is not None and used.attachment is not None:
        raise LindyError(f"{where}: the attached {used.path} is damaged; name one with --vehicle")
    recording.require_messages()
    raise LindyError(f"{where} holds no vehicle file; name one with --vehicle")


def _decoded(data: bytes, recording: Recording) -> FlownDive:
    try:
        found: Any = msgspec.json.decode(data, type=FlownDive)
    except UNDECODABLE as error:
        raise LindyError(f"{recording.files[0]}: the attachment {DIVE}: {error}") from None
    return found
