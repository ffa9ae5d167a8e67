"""`lindy fault`: makes a thruster or a sensor of the simulated vehicle fail, or repairs it."""

from pathlib import Path
from typing import get_args

from messages import topics
from messages.simulator import FaultKind, FaultRequest
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.hosts.registry import Registry
from tools.ask import dive_in
from tools.live.asking import answer_to, at_once

SIMULATOR, DRONE = "simulator", "drone"


def fault(part: str, kind: str, value: float | None, dive: Path | None) -> int:
    """Returns the exit status.

    Raises:
        LindyError: no such fault, or the simulator refuses or does not answer.
    """
    kinds: dict[str, FaultKind] = {name: name for name in get_args(FaultKind)}
    if kind not in kinds:
        raise LindyError(f"unknown fault {kind!r}{nearest(kind, list(kinds))}")
    running = dive_in(dive)
    if running.stack_file and SIMULATOR not in Registry.read(running.stack_file):
        raise LindyError(
            f"only a simulated vehicle can be broken on purpose, and this dive has none: its stack "
            f"is {running.stack_file}"
        )
    if DRONE not in running.endpoints:
        raise LindyError(
            "parts are broken on the drone's machine only: no other machine can ask for it; call "
            "this there"
        )
    request = FaultRequest(stamp_ns=0, id="", part=part, fault=kinds[kind], value=value)
    answer = answer_to(
        lambda node: at_once(node, request, topics.FAULT_REQUEST, topics.FAULT_ANSWER),
        running,
        SIMULATOR,
    )
    if not answer.accepted:
        raise LindyError(f"the simulator refuses: {answer.reason}")
    print(f"{part}: {'mended' if kind == 'none' else kind}")
    return 0
