"""The file `run.json` in the folder of a running dive: how to reach its processes."""

import os
from pathlib import Path

import msgspec

RUNNING = "run.json"


class Running(msgspec.Struct, frozen=True):
    vehicle: str  # name of the drone on the network
    endpoints: dict[str, str]  # side → hub's endpoint
    supervisor: int  # process id
    pids: dict[str, int]  # process id of every hub and service; some services may share one
    stack_file: str = ""  # path of the stack file
    changes: bool = False  # its pilot may take another drone: it was started by `lindy fly`


def running_in(folder: Path) -> int | None:
    """Process id of the running dive in a folder; None: there is none."""
    try:
        pid = msgspec.json.decode((folder / RUNNING).read_bytes(), type=Running).supervisor
    except (FileNotFoundError, msgspec.DecodeError):
        return None
    try:
        os.kill(pid, 0)  # signal 0 only asks whether it exists
    except ProcessLookupError:
        return None
    except PermissionError:
        pass  # it exists, and is somebody else's
    return pid
