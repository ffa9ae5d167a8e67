"""What each program of the drone's side hands on to the next."""

import os
import sys
from pathlib import Path
from tempfile import TemporaryFile
from typing import Literal, NoReturn, TypeVar

import msgspec

from services.runtime.launch.dive import Dive
from services.runtime.os import system
from tools.health_sums import HealthSums
from tools.live.stop_signals import SIGNALS

S = TypeVar("S", bound=msgspec.Struct)
Program = Literal["supervise", "report"]


class DroneStart(msgspec.Struct, frozen=True):
    """A dive of the drone's side that is about to begin."""

    dive: Dive
    claim: int | None  # descriptor of the lock of the dive's folder


class Seen(msgspec.Struct, kw_only=True):
    """What only the supervisor knows of a dive that is over."""

    exit: str = "clean"  # or why it ended otherwise
    restarts: dict[str, int] = {}  # times each service and hub was started again
    hung: dict[str, int] = {}  # times each process did not answer
    gone: list[str] = []  # services that were not alive at the end
    armed: bool = False  # at some time
    health: dict[str, HealthSums] = {}  # by service


class DiveEnd(msgspec.Struct, frozen=True):
    """A dive that is over."""

    dive: Dive
    seen: Seen


def become(program: Program, what: msgspec.Struct) -> NoReturn:
    """Replace the program that this process runs, and with it everything in its memory. The process
    id stays, so whoever started it, a terminal or systemd, sees one program.

    Signals wait until the next program can handle them (`StopSignals`).
    """
    content = _in_memory(msgspec.json.encode(what, enc_hook=str))
    system.hold_back(SIGNALS)
    sys.stdout.flush()
    command = [sys.executable, "-P", "-m", f"{__package__}.{program}", str(content)]
    os.execv(sys.executable, command)


def handed_on(kind: type[S]) -> S:
    """What the program before this one has handed on."""
    with os.fdopen(int(sys.argv[1]), "rb") as file:
        return msgspec.json.decode(file.read(), type=kind, dec_hook=path)


def path(_: type, text: str) -> Path:
    """JSON has no paths."""
    return Path(text)


def _in_memory(data: bytes) -> int:
    """The descriptor of a file with this content, for the next program. An argument of a command
    may have 128 kB at most, and the health of a day has more."""
    if sys.platform == "linux":  # needs no disk
        descriptor = os.memfd_create("lindy", 0)
    else:
        with TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
        os.set_inheritable(descriptor, True)
    with os.fdopen(descriptor, "r+b", closefd=False) as file:
        file.write(data)
    os.lseek(descriptor, 0, os.SEEK_SET)
    return descriptor
