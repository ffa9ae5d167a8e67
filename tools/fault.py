"""`lindy fault`: makes a thruster or a sensor of the simulated vehicle fail, or repairs it."""

from typing import Annotated, get_args

from cyclopts import Parameter

from messages import topics
from messages.simulator import FaultKind, FaultRequest
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.hosts.registry import Registry
from tools.ask import answer_to, at_once, dive_in
from tools.choices import RunningDive

SIMULATOR, DRONE = "simulator", "drone"
MOST_VALUE = 1e9  # as in a message


def fault(
    part: str,
    kind: str,
    /,
    *,
    value: Annotated[
        float | None,
        Parameter(
            help="weak: share of the thrust; noisy: times; biased: sensor's unit; wrong_lock: m/s"
        ),
    ] = None,
    dive: RunningDive = None,
) -> int:
    """Make a part of the simulated vehicle fail, or repair it.

    PART is a thruster's name, a sensor such as pressure, or all. KIND is none (to repair); dead,
    reversed, weak or stuck (a thruster); silent, frozen, noisy, biased or broken (a sensor); wet
    (leak); low, critical or empty (battery); hot (temperature); no_lock or wrong_lock (dvl).

    Example: lindy fault port dead
    """
    kinds: dict[str, FaultKind] = {name: name for name in get_args(FaultKind)}
    if kind not in kinds:
        repair = "; none repairs a part"
        raise LindyError(f"unknown fault {kind!r}{nearest(kind, list(kinds))}{repair}")
    if value is not None and not abs(value) <= MOST_VALUE:  # NaN is in no range
        raise LindyError(f"--value is {value:g}, allowed are -{MOST_VALUE:g} to {MOST_VALUE:g}")
    running = dive_in(dive)
    if running.stack_file and SIMULATOR not in Registry.read(running.stack_file):
        raise LindyError(
            f"only a simulated vehicle can be broken on purpose, and this dive has none: its stack "
            f"is {running.stack_file}"
        )
    if DRONE not in running.endpoints:
        raise LindyError(
            "parts are broken on the drone's machine only: no other machine can ask for it; call "
            "this there, and name the folder of the drone's side with --dive if this is one machine"
        )
    part = part.removeprefix("sensor/")  # as its topic is called
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
