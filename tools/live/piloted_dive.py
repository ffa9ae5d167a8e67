"""A dive that is piloted from this machine: chooses the pilot, and disarms at the end."""

import time
from collections.abc import Collection

from messages import topics
from messages.vehicle import VehicleStatus
from services.runtime.config.errors import LindyError
from services.runtime.launch.local_stack import LocalStack
from tools.checks import DEFAULT_PILOT, PilotChoice, pilot_of
from tools.choices import Choices
from tools.live.disarming import Disarming
from tools.live.display import Display
from tools.live.dive_timeline import DiveTimeline
from tools.live.monitor_loop import MonitorLoop
from tools.live.own_pilot import OwnPilot
from tools.live.pads import pad_is_there
from tools.live.stop_signals import StopSignals
from tools.report.restarted import restarted

KNOWN_S = 0.25  # [s] until a status tells who has control now
GAMEPAD = "gamepad"  # the pilot, unless the stack has one of these in its place
IN_PLACE = {"mavlink": "a ground station", "cockpit": "a browser", "ros2": "a node of ROS 2"}
DISARM_S = 1.0  # [s] at most, for the drone's answer at the end


def who_flies(
    choices: Choices, services: Collection[str], *, elsewhere: bool = False
) -> PilotChoice:
    """The pilot that the user chose; else the gamepad; else, where none is plugged in, a script.
    Where the stack has a ground station or a browser in place of the gamepad, it is the pilot.

    Args:
        elsewhere: the drone is another program's, perhaps a real one: no script flies that nobody
            has chosen.

    Raises:
        LindyError: no such pilot, a mistake in the script, or nobody to fly.
    """
    others = [name for name in IN_PLACE if name in services]
    if others and GAMEPAD not in services:
        if choices.pilot is not None:
            raise LindyError(
                f"--pilot {choices.pilot}: {IN_PLACE[others[0]]} flies in the stack "
                f"{choices.stack}; allowed with a stack that has [services.{GAMEPAD}]"
            )
        return PilotChoice(others[0])
    if choices.pilot is None and not pad_is_there():
        if elsewhere:
            raise LindyError(
                "no gamepad is plugged in: plug one in, or say who flies, with --pilot keyboard, "
                f"--pilot {DEFAULT_PILOT} or another script"
            )
        return pilot_of(DEFAULT_PILOT)
    return pilot_of(choices.pilot or "gamepad")


def tell_who_flies(choices: Choices, pilot: PilotChoice) -> None:
    """Announce a script that the user did not choose."""
    if choices.pilot is None and pilot.script_s is not None:
        print(f"no gamepad is plugged in: {DEFAULT_PILOT} flies", flush=True)


class PilotedDive:
    """A dive between the start of the hubs and the end of the services."""

    def __init__(
        self,
        local: LocalStack,
        pilot: PilotChoice,
        stop: StopSignals,
        shown: Display,
    ) -> None:
        self._own = OwnPilot(local.node)
        self._timeline = DiveTimeline(
            pilot.script_s,
            local.stack.seconds,
            self._own.in_control,
            lambda: restarted(local.restarts, local.plan.services.shared),
        )
        stop.armed = self._armed
        self._monitor = MonitorLoop(local, self._timeline, stop, shown)
        self._disarming = Disarming(local.node, self._own)
        self._releases = local.stack.apart  # other pilots may go on with the drone
        self._drone = local.stack.drone_name
        self.status: VehicleStatus | None = None  # the newest
        local.node.each(topics.STATUS, self._hear)
        self.left = ""  # what has become of the drone, where it goes on without this side

    def fly(self) -> str:
        """Run the dive. Returns how it ended: `clean`, or why not.

        Raises:
            LindyError: a service cannot start, or the drone does not arm.
        """
        end = self._monitor.keep()
        self.disarm()
        return end

    def _armed(self) -> str:
        """Whether the pilot here has the drone armed, and where."""
        return f"armed{self._depth()}" if self._timeline.armed else ""

    def _depth(self) -> str:
        depth = None if self.status is None else self.status.depth
        return f" at {depth:.1f} m" if isinstance(depth, float) else ""

    def _hear(self, status: VehicleStatus, _: int) -> None:
        self.status = status

    def disarm(self) -> None:
        """Ask the drone to disarm, and give control up, if this side's pilot has control. Wait for
        the answers, at most `DISARM_S`."""
        known = time.monotonic() + KNOWN_S
        while time.monotonic() < known:
            self._monitor.look()
        disarm = ("disarm",) if self._timeline.armed else ()
        release = ("release",) if self._releases and self._timeline.controlled else ()
        self._disarming.kinds = (*disarm, *release)
        deadline = time.monotonic() + DISARM_S
        while not self._disarming.done and time.monotonic() < deadline:
            self._disarming.ask(time.monotonic_ns())
            self._monitor.look()
        status = self.status
        if self._releases and disarm and status is not None and not status.armed:
            self.left = f"{self._drone} is disarmed{self._depth()}: nothing holds it now"
