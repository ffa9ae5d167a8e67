"""The file `run.json` in the folder of a running dive: how to reach its processes."""

import msgspec

RUNNING = "run.json"


class Running(msgspec.Struct, frozen=True):
    vehicle: str  # its name in keys
    endpoints: dict[str, str]  # side → hub's endpoint
    supervisor: int  # process id
    pids: dict[str, int]  # process id of every hub and service; some services may share one
    stack_file: str = ""  # path of the stack file
