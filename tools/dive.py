"""`lindy dive`: the whole stack as processes on this machine, piloted, recorded and summed up."""

import os
import time

import msgspec

from messages import topics
from services.runtime.local_stack import LocalStack, local_stack
from services.runtime.stack import services_of
from tools.checks import DEFAULT_PILOT, Pilot, checked, out_folder, pilot_of
from tools.choices import Choices
from tools.course import Course
from tools.disarming import Disarming
from tools.display import Display, display
from tools.outcome import Outcome, title
from tools.pads import pad_is_there
from tools.screen import View
from tools.stop import Stop
from tools.watch import Watch

ALIVE_S = 30.0  # [s] for all services to start, on a slow and busy computer
DISARM_S = 1.0  # [s] at most, for the drone's answer at the end


def dive(choices: Choices, *, headless: bool, listen: str | None) -> int:
    """Returns the exit status: 0 clean, 3 done but data was lost.

    Raises:
        LindyError: something is set wrongly, or the dive ended before its time.
    """
    by_default = choices.pilot is None and not pad_is_there()
    pilot = pilot_of(choices.pilot or (DEFAULT_PILOT if by_default else "gamepad"))
    viewer = not headless and bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())
    stack = checked(choices, pilot)
    stack = msgspec.structs.replace(stack, viewer=viewer, out=str(out_folder(choices.out)))
    outcome = Outcome(stack)
    if by_default:
        print(f"no gamepad is plugged in: {DEFAULT_PILOT} flies", flush=True)
    print(f"{title(stack)} → {stack.out_dir}", flush=True)
    with (
        Stop() as stop,
        display() as shown,
        outcome.of_the_dive(),
        local_stack(stack, services_of("dive"), listen) as local,
    ):
        outcome.restarts = lambda: local.supervisor.restarts
        outcome.listen(local.node)
        outcome.exit = Flight(local, pilot, choices.seconds, stop, shown).fly()
    return outcome.sum_up()


class Flight:
    """A dive between the start of the hubs and the end of the services."""

    def __init__(
        self, local: LocalStack, pilot: Pilot, seconds: float | None, stop: Stop, shown: Display
    ) -> None:
        node = local.node
        self._local, self._stop, self._shown = local, stop, shown
        self._course = Course(pilot.script_s, seconds)
        self._watch = Watch(node, list(local.rows), shown.line)
        self._disarming = Disarming(node)
        node.each(topics.STATUS, self._course.see)

    def fly(self) -> str:
        """How it ended: `clean`, or why not.

        Raises:
            LindyError: a service cannot start, or the drone does not arm.
        """
        self._local.start_services()
        self._local.wait_alive(ALIVE_S, self._look)
        self._course.began_ns = time.monotonic_ns()
        end = None
        while end is None and not self._stop.asked:
            self._look()
            end = self._course.over(time.monotonic_ns())
        self._disarm()
        return end or "clean"

    def _disarm(self) -> None:
        """Ask the drone to stop its thrusters, and wait for its word, but not for long."""
        deadline = time.monotonic() + DISARM_S
        while self._course.armed and not self._disarming.done and time.monotonic() < deadline:
            self._disarming.ask(time.monotonic_ns())
            self._look()

    def _look(self) -> bool:
        """Let everything happen that is due. False: the user wants to stop."""
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
