"""The attachment `dive.json` of a recording: what was flown, by which Lindy, from which files."""

import hashlib
import os
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import msgspec

from messages.payload import UNDECODABLE
from services.recorder.io.attachments import DIVE
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY, read_text, reading_copies
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
    if (data := recording.attachment(DIVE)) is None:
        return None
    try:
        return msgspec.json.decode(data, type=FlownDive)
    except UNDECODABLE as error:
        raise LindyError(f"{recording.files[0]}: the attachment {DIVE}: {error}") from None


def flown_with(recording: Recording) -> FlownDive | None:
    """What it says of its dive, or, where that is not attached, what it was flown with by the names
    of its files, of which the vehicle's is the first; None: no vehicle file is in it.

    Raises:
        LindyError: what it carries is damaged.
    """
    dive = flown_dive(recording)
    if dive is None:
        about, names = recording.metadata("dive"), [each.name for each in recording.attachments()]
        first = next((Path(name).stem for name in names if name.endswith(".toml")), "")
        stems = {"vehicles": about.get("vehicle", first), "links": about.get("link", "perfect")}
        try:
            stack = FlownStack(
                vehicle=stems["vehicles"],
                link=stems["links"],
                pilot=about.get("pilot", "gamepad"),
                seed=int(about.get("seed", "0")),
                overrides=msgspec.json.decode(about.get("overrides", "[]"), type=list[str]),
            )
        except ValueError as error:
            raise LindyError(
                f"{recording.files[0]} does not say with which seed and settings it was flown: "
                f"{error}"
            ) from None
        files = [
            UsedFile(f"{folder}/{stem}.toml", shipped=True, attachment=f"{stem}.toml")
            for folder, stem in stems.items()
            if f"{stem}.toml" in names
        ]
        dive = FlownDive({}, {}, stack, files)
    used = dive.named("vehicles", dive.stack.vehicle, ".toml")
    return None if used is None else dive


@contextmanager
def flown_stack(
    recording: Recording, *, virtual: bool = False, apart: bool = False
) -> Generator[tuple[Stack, dict[str, str]]]:
    """The settings of a recorded dive, and the copies of its files, which are read meanwhile.

    Raises:
        LindyError: the vehicle file is not in the recording, or what is wrong in one of them.
    """
    where, dive = recording.files[0], flown_with(recording)
    if dive is None:
        recording.require_messages()
        raise LindyError(f"{where} holds no vehicle file, so its settings are not known")
    used = [file for file in dive.files if file.path.endswith(".toml")]  # no script
    with TemporaryDirectory(prefix="lindy-") as folder:
        copies = unpacked(recording, used, Path(folder))
        stack = Stack(
            vehicle=dive.stack.vehicle,
            link=dive.stack.link,
            pilot=dive.stack.pilot,
            seed=dive.stack.seed,
            overrides=[*dive.stack.overrides],
            virtual=virtual,
            apart=apart,
            out=folder,
        )
        try:
            with reading_copies(copies):
                yield stack, copies
        except LindyError as error:  # of a file as it was, not as it is now
            said = str(error)
            for path in copies:
                said = said.replace(path, f"{where}: {Path(path).name}")
            raise LindyError(said) from None


def flown_section(recording: Recording, name: str, kind: type[S]) -> S | None:
    """A table of the vehicle file that the dive was flown with, and what was set on top; None: the
    recording does not carry it.

    Raises:
        LindyError: what it carries is damaged.
    """
    if flown_with(recording) is None:
        return None
    with flown_stack(recording) as (stack, _):
        return stack.section(name, kind)


def vehicle_attached(recording: Recording) -> tuple[str, str]:
    """Name and text of the vehicle file that the dive was flown with.

    Raises:
        LindyError: the recording does not carry it, or it is damaged; says what helps.
    """
    if recording.attachment(DIVE) is None:
        recording.require_messages()
    try:
        with flown_stack(recording) as (stack, _):
            return stack.vehicle_path.name, read_text(stack.vehicle_path)
    except LindyError as error:
        raise LindyError(f"{error}; name one with --vehicle") from None


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
        raise LindyError(f"{recording.files[0]}: the attached {file.path} is damaged")
    return copies
