"""A note beside the checkpoints of a dive: on which start of the computer it began, and whether it
was ended because somebody wanted it. Every start of the computer has its own id."""

from pathlib import Path

import msgspec

from services.runtime.node.checkpoint import write_safely

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")  # Linux only
NOTE = "this-start"  # its name, without .json; no service has a name with a hyphen


class Start(msgspec.Struct, frozen=True):
    boot_id: str  # of the computer's start
    vehicle: str
    began_ns: int  # [ns] of the clock that began with the computer
    ended: bool = False  # deliberately; else the dive broke off, or goes on


def boot_id() -> str | None:
    """Of this start of the computer; None: not Linux."""
    try:
        return BOOT_ID.read_text().strip()
    except OSError:
        return None


def read(path: Path) -> Start | None:
    """None: there is no such note, or not a whole one."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Start)
    except (OSError, msgspec.DecodeError, msgspec.ValidationError):
        return None


def mark_ended(checkpoints: Path) -> None:
    """The dive with these checkpoints was ended deliberately.

    Raises:
        OSError: the disk failed.
    """
    path = checkpoints / f"{NOTE}.json"
    if (start := read(path)) is not None:
        write_safely(path, msgspec.json.encode(msgspec.structs.replace(start, ended=True)))
