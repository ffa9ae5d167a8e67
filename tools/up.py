"""`lindy up`: one side of a dive on this machine, the other side on another one."""

import time

import msgspec

from messages import topics
from services.runtime.errors import LindyError
from services.runtime.local_stack import Far, LocalStack, local_stack
from services.runtime.settings import nearest
from services.runtime.stack import Row, services_of
from tools.checks import DEFAULT_PILOT, checked, out_folder, pilot_of
from tools.choices import Choices
from tools.course import Course
from tools.display import Display, display
from tools.dive import ALIVE_S, Flight
from tools.outcome import title
from tools.pads import pad_is_there
from tools.screen import View
from tools.stop import Stop
from tools.watch import Watch

SIDES = ("topside", "drone")
GATEWAY = "tether"  # the service that may stand between the two


def up(side: str, choices: Choices, *, listen: str, connect: str, gateway: bool) -> int:
    """Returns the exit status.

    Raises:
        LindyError: something is set wrongly, or a service cannot start.
    """
    if side not in SIDES:
        raise LindyError(f"unknown side {side!r}{nearest(side, list(SIDES))}")
    return drone(choices, listen) if side == "drone" else topside(choices, connect, gateway)


def drone(choices: Choices, listen: str) -> int:
    """Until Ctrl-C: on board everything goes on, whether or not the topside is there."""
    stack = checked(choices, pilot_of(choices.pilot or DEFAULT_PILOT))
    stack = msgspec.structs.replace(stack, apart=True, out=str(out_folder(choices.out)))
    rows = rows_of("drone", gateway=False)
    print(f"drone {stack.vehicle}, for the topside at {listen} → {stack.out_dir}", flush=True)
    with (
        Stop() as stop,
        display() as shown,
        local_stack(stack, rows, far=Far("drone", listen=(listen,))) as local,
    ):
        OnBoard(local, choices.seconds, stop, shown).go_on()
    return 0


def topside(choices: Choices, connect: str, gateway: bool) -> int:
    """A dive as `lindy dive` flies it; what is recorded is recorded on board."""
    by_default = choices.pilot is None and not pad_is_there()
    pilot = pilot_of(choices.pilot or (DEFAULT_PILOT if by_default else "gamepad"))
    stack = checked(choices, pilot)
    stack = msgspec.structs.replace(stack, apart=True, out=str(out_folder(choices.out)))
    # Either the two hubs are joined, or the tether process stands between them.
    far = Far("topside", gateway=connect) if gateway else Far("topside", connect=(connect,))
    way = f"{stack.link} at {connect}" if gateway else connect
    print(f"topside of {stack.vehicle}, drone by way of {way} → {stack.out_dir}", flush=True)
    rows = rows_of("topside", gateway=gateway)
    with Stop() as stop, display() as shown, local_stack(stack, rows, far=far) as local:
        end = Flight(local, pilot, choices.seconds, stop, shown).fly()
    if end != "clean":
        raise LindyError(end)
    return 0


def rows_of(side: str, *, gateway: bool) -> dict[str, Row]:
    """The services whose home is on this side; they hear no other realm but through the link."""
    rows: dict[str, Row] = {}
    for name, row in services_of("dive").items():
        if name == GATEWAY:
            if gateway:
                rows[name] = row
        elif row.realms[0] == side:
            rows[name] = msgspec.structs.replace(row, realms=[side])
    return rows


class OnBoard:
    """The drone's side between the start of its services and their end."""

    def __init__(
        self, local: LocalStack, seconds: float | None, stop: Stop, shown: Display
    ) -> None:
        self._local, self._stop, self._shown = local, stop, shown
        self._course = Course(None, seconds)
        self._watch = Watch(local.node, list(local.rows), shown.line)
        local.node.each(topics.STATUS, self._course.see)

    def go_on(self) -> None:
        """Until the user has had enough.

        Raises:
            LindyError: a service cannot start.
        """
        self._local.start_services()
        self._local.wait_alive(ALIVE_S, self._look)
        self._course.began_ns = time.monotonic_ns()
        while self._look() and self._course.over(time.monotonic_ns()) is None:
            pass

    def _look(self) -> bool:
        self._local.pump()
        self._shown.show(self._view)
        return not self._stop.asked

    def _view(self) -> View:
        local = self._local
        return self._watch.view(
            title(local.stack),
            self._course,
            time.monotonic_ns(),
            local.missing(),
            local.supervisor.restarts,
        )
