"""A note beside the checkpoints of a dive: on which start of the computer it began, with which
vehicle, and whether it was ended because somebody wanted it. Every start of the computer has its
own id."""

from pathlib import Path

import msgspec

from messages.identity import SideIdentity
from messages.payload import UNDECODABLE
from services.runtime.node.checkpoint import write_safely

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")  # Linux only
NOTE = "this-start"  # its name, without .json; no service has a name with a hyphen


class StartNote(msgspec.Struct, frozen=True):
    boot_id: str  # of the computer's start; empty: not Linux
    vehicle: str  # name of the drone on the network
    began_ns: int  # [ns] of the clock that began with the computer
    ended: bool = False  # deliberately; else the dive broke off, or goes on
    vehicle_file: str = ""  # its name; empty: an older Lindy wrote this note
    vehicle_hash: str = ""  # of the table [vehicle] of that file, with what --set changed


def boot_id() -> str | None:
    """Of this start of the computer; None: not Linux."""
    try:
        return BOOT_ID.read_text(encoding="utf-8").strip()
    except OSError:
        return None


def read(path: Path) -> StartNote | None:
    """None: there is no such note, or not a whole one."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=StartNote)
    except (OSError, *UNDECODABLE):
        return None


def other_vehicle(then: StartNote | None, now: SideIdentity) -> str:
    """Why what was learnt then is not of the vehicle that is started now; empty: it is.

    Args:
        then: the note beside what was learnt; None: there is none.
    """
    if then is None or not then.vehicle_hash:
        return "nothing beside it says with which vehicle it was measured"
    if then.vehicle_hash != now.vehicle_hash:
        return (
            f"it was measured with the vehicle {then.vehicle_file}, and the table [vehicle] of "
            f"{now.vehicle} differs, or a --set"
        )
    return ""


def mark_ended(checkpoints: Path) -> None:
    """The dive with these checkpoints was ended deliberately.

    Raises:
        OSError: the disk failed.
    """
    path = checkpoints / f"{NOTE}.json"
    if (start := read(path)) is not None:
        write_safely(path, msgspec.json.encode(msgspec.structs.replace(start, ended=True)))
