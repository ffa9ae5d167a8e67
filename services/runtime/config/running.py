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
    vehicle_file: str = ""  # path of the vehicle file; empty: an older Lindy wrote this
    overrides: tuple[str, ...] = ()  # key.path=value into it
    began: float | None = None  # when the supervisor began: its id may be another program's later


def running_in(folder: Path) -> Running | None:
    """The dive that is going on in a folder; None: there is none."""
    try:
        running = msgspec.json.decode((folder / RUNNING).read_bytes(), type=Running)
    except (OSError, *UNDECODABLE):
        return None
    if running.began is not None and running.began != system.began(running.supervisor):
        return None
    return running if system.exists(running.supervisor) else None
