"""`lindy up`: one side of a dive on this machine, the other side on another one."""

from collections.abc import Callable, Mapping

import msgspec

from services.runtime.endpoint import checked_endpoint
from services.runtime.errors import LindyError
from services.runtime.local_stack import Far, LocalStack, local_stack
from services.runtime.settings import nearest
from services.runtime.stack import Row, Stack, apart, services_of
from tools.checks import DEFAULT_PILOT, checked, pilot_of
from tools.choices import Choices
from tools.course import Course
from tools.display import Display, display
from tools.dive_folder import out_folder, point_latest
from tools.flight import Flight, tell_who_flies, who_flies
from tools.lookout import Lookout, told
from tools.outcome import RECORDER, Outcome
from tools.report import Elsewhere
from tools.stop import Stop
from tools.viewer import runnable

OTHER = {"topside": "drone", "drone": "topside"}
GATEWAY = "tether"  # the service that may stand between the two

Go = Callable[[LocalStack, Stop, Display], str]


def up(side: str, choices: Choices, *, listen: str, connect: str, gateway: bool) -> int:
    """Returns the exit status: 0 clean, 3 done but data was lost.

    Raises:
        LindyError: something is set wrongly, a service cannot start, or the dive ended before its
            time.
    """
    if side not in OTHER:
        raise LindyError(f"unknown side {side!r}{nearest(side, list(OTHER))}")
    if side == "drone":
        return drone(choices, checked_endpoint(listen, "--listen"))
    return topside(choices, checked_endpoint(connect, "--connect"), gateway)


def drone(choices: Choices, listen: str) -> int:
    """Until Ctrl-C: on board everything goes on, whether or not the topside is there."""
    stack = checked(choices, pilot_of(choices.pilot or DEFAULT_PILOT))
    # Who has the sticks, and what the link is like, is the topside's affair.
    stack = msgspec.structs.replace(stack, apart=True, pilot=OTHER["drone"], link=listen)
    stack = msgspec.structs.replace(stack, out=str(out_folder(choices.out)))
    print(f"drone {stack.vehicle}, for the topside at {listen} → {stack.out_dir}", flush=True)

    def go(local: LocalStack, stop: Stop, shown: Display) -> str:
        return Lookout(local, Course(None, choices.seconds), stop, shown).keep()

    return run(stack, rows_of("drone", gateway=False), Far("drone", listen=(listen,)), go)


def topside(choices: Choices, connect: str, gateway: bool) -> int:
    """A dive as `lindy dive` flies it; what is recorded is recorded on board."""
    pilot = who_flies(choices)
    stack = checked(choices, pilot)
    stack = msgspec.structs.replace(stack, apart=True, out=str(out_folder(choices.out)))
    # Either the two hubs are joined, or the tether process stands between them.
    far = Far("topside", gateway=connect) if gateway else Far("topside", connect=(connect,))
    way = f"{stack.link} at {connect}" if gateway else connect
    tell_who_flies(choices, pilot)
    print(f"topside of {stack.vehicle}, drone by way of {way} → {stack.out_dir}", flush=True)

    def go(local: LocalStack, stop: Stop, shown: Display) -> str:
        return Flight(local, pilot, choices.seconds, stop, shown).fly()

    return run(stack, rows_of("topside", gateway=gateway), far, go)


def run(stack: Stack, rows: Mapping[str, Row], far: Far, go: Go) -> int:
    """One side from its start to its last words. Returns the exit status."""
    outcome = Outcome(stack)
    rows = runnable(rows)
    with (
        Stop() as stop,
        display() as shown,
        outcome.of_the_dive(),
        local_stack(stack, rows, far=far) as local,
        told(outcome, local),
    ):
        point_latest(stack.out_dir)
        outcome.exit = go(local, stop, shown)
    other = OTHER[far.side]
    if RECORDER in rows:
        return outcome.sum_up(Elsewhere(other, tuple(rows_of(other, gateway=False))))
    return outcome.sum_up_unrecorded(far.side, other)


def rows_of(side: str, *, gateway: bool) -> dict[str, Row]:
    """The services whose home is on this side; they hear no other realm but through the link."""
    rows: dict[str, Row] = {}
    for name, row in apart(services_of("dive")).items():
        if name == GATEWAY:
            if gateway:
                rows[name] = row
        elif row.realms[0] == side:
            rows[name] = msgspec.structs.replace(row, realms=[side])
    return rows
