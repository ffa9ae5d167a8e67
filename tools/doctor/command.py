"""The verb `lindy doctor`."""

import time
from collections.abc import Callable
from typing import Annotated

from cyclopts import Parameter

from messages.text import harmless
from messages.units import Ns
from services.ardusub.commands import servos_of
from services.ardusub.core import HEARD
from services.ardusub.service import ONE_BOARD
from services.ardusub.settings import Settings
from services.estimation.settings import Settings as EstimationSettings
from services.marine.vehicle import Vehicle
from services.mavlink_io.io.endpoint import HeardMessages, MavlinkEndpoint
from services.mavlink_io.io.links import ByteLinks, Links
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import override, read_toml
from services.runtime.config.stack import BODY, Stack
from services.runtime.hosts.registry import Registry
from tools.checks import PilotChoice, checked
from tools.choices import Choices, Json, Overrides, VehicleName
from tools.doctor.board_checks import VehicleFinding, as_json, as_lines, fit, of_board, of_file
from tools.doctor.instrument_checks import STACK, of_instruments, wanted
from tools.doctor.visit import BoardVisit
from tools.packages import lacking

LONGEST_S = 600.0  # [s] of --seconds
STEP_S = 0.005  # [s] between two looks at the link
# As whom it speaks: not as Lindy, so that it can be used beside it.
SYSTEMS, COMPONENT = (247, 248), 191


def doctor(
    *,
    vehicle: VehicleName = "pioneer",
    stack: Annotated[
        str | None,
        Parameter(
            help="a name in deploy/stacks, or a TOML file; default: ardusub for a vehicle file "
            "with a table [ardusub], ardusub_instruments for one with an instrument, else simulated"
        ),
    ] = None,
    seconds: Annotated[float, Parameter(help="[s] for which rates are measured")] = 5.0,
    set_: Overrides = (),
    json: Json = False,
) -> int:
    """Check a vehicle file, its ArduSub board and its instruments.

    Run it before you fly. It checks board and instruments only where the file names them, and
    prints a line for each thing: ok, change or missing. The exit status is 0 where all fits, else
    1. It arms nothing, moves nothing and sets no parameter. Only one program can use an endpoint:
    stop the dive before running the doctor.

    Example: lindy doctor --vehicle bluerov2_heavy
             lindy doctor --vehicle mine.toml --set ardusub.url=serial:/dev/ttyACM0:115200
    """
    if not 0.5 <= seconds <= LONGEST_S:
        raise LindyError(f"--seconds is {seconds:g}, expected 0.5 to {LONGEST_S:g}")
    tree = read_toml(Stack(vehicle=vehicle).vehicle_path)
    override(tree, set_)
    usual = STACK if wanted(tree) else "ardusub" if "ardusub" in tree else "simulated"
    stack = stack or usual
    services = Registry.read(stack)
    checked_stack = checked(
        Choices(vehicle=vehicle, stack=stack, set_=set_), PilotChoice("gamepad"), services
    )
    found = of_file(checked_stack, simulated="simulator" in services)
    of_a_board, asked = "ardusub" in tree, "ardusub" in services
    if of_a_board != asked:
        found.append(_other_stack(stack, asked=asked))
    elif not asked:
        found.append(VehicleFinding("ok", "board", "none: the vehicle file has no table [ardusub]"))
    if asked and (why := lacking(services)) is not None:
        found.append(VehicleFinding("missing", "board", f"not asked: {why}"))
    elif asked:
        found += _of_board(checked_stack, checked_stack.section(BODY, Vehicle), seconds)
    found += of_instruments(checked_stack, tree, services, seconds, time.monotonic_ns, _wait)
    print(as_json(found) if json else harmless(as_lines(found)))
    return 0 if fit(found) else 1


def _other_stack(stack: str, *, asked: bool) -> VehicleFinding:
    """The stack has a board and the vehicle file does not, or the other way about."""
    if not asked:
        return VehicleFinding("ok", "board", f"not asked: the stack {stack} has no ardusub")
    text = f"the vehicle file has no table [ardusub]: asked at {Settings().url}, as by default"
    return VehicleFinding("change", "board", text)


def _of_board(stack: Stack, vehicle: Vehicle, seconds: float) -> list[VehicleFinding]:
    """Raises LindyError: the port cannot be opened, or no pymavlink is installed."""
    settings, motors = stack.section("ardusub", Settings), len(vehicle.thruster)
    visit = BoardVisit(settings, motors, seconds, servos_of(vehicle.output))
    links = Links([settings.url], "ardusub.url", ONE_BOARD, visit.lost)
    try:
        go_through(visit, links, time.monotonic_ns, _wait)
    finally:
        links.close()
    estimation = stack.section("estimation", EstimationSettings)
    return of_board(visit, vehicle, settings.url, estimation.watch, links.trouble)


def _wait() -> None:
    """Until the next look at a link."""
    time.sleep(STEP_S)


def go_through(
    visit: BoardVisit, links: ByteLinks, now: Callable[[], Ns], wait: Callable[[], None]
) -> None:
    """The visit over a link, to its end, which comes whatever is heard.

    Args:
        wait: until the next look at the link.
    """

    system = next(s for s in SYSTEMS if s != visit.settings.system)
    heard = HeardMessages(visit.settings.board, HEARD)
    board = MavlinkEndpoint(links, visit.lost, system, COMPONENT, heard=heard)
    while visit.stage != "done":
        packets = board.receive()
        arrival = now()
        for packet in packets:
            visit.hear(packet, arrival)
        for packet in visit.tick(now()):
            board.send(packet)
        wait()
