"""The file `run.json` in the folder of a running dive: how to reach its processes."""

from pathlib import Path

import msgspec

from messages.payload import UNDECODABLE
from services.runtime.os import system

RUNNING = "run.json"


class Running(msgspec.Struct, frozen=True):
    vehicle: str  # name of the drone on the network
    endpoints: dict[str, str]  # side → hub's endpoint
    supervisor: int  # process id
    pids: dict[str, int]  # process id of every hub and service; some services may share one
    stack_file: str = ""  # path of the stack file
    left_for: str = (
        ""  # folder of the dive that its pilot has gone over to; empty: he flies this one
    )
    changes: bool = False  # its pilot may take another drone: it was started by `lindy fly`


def running_in(folder: Path) -> int | None:
    """Process id of the running dive in a folder; None: there is none."""
    running = _noted(folder)
    return None if running is None or running.left_for else running.supervisor


def followed_from(folder: Path) -> Running | None:
    """The dive that is going on in a folder, or the one that its pilot has gone over to from there;
    None: there is none."""
    running = _noted(folder)
    while running is not None and running.left_for:
        running = _noted(Path(running.left_for))  # each was left for a newer one
    return running


def _noted(folder: Path) -> Running | None:
    """What a folder says of a program that is there."""
    try:
        running = msgspec.json.decode((folder / RUNNING).read_bytes(), type=Running)
    except (FileNotFoundError, *UNDECODABLE):
        return None
    return running if system.exists(running.supervisor) else None
