"""`lindy ros2`: shows a running dive in ROS 2, and has it flown from there."""

import os
import signal
import tempfile
import threading
from pathlib import Path

from msgspec.structs import replace

from services.runtime.config.errors import LindyError
from services.runtime.config.running import Running
from services.runtime.hosts.process_host import Launch, run_services
from services.runtime.hosts.registry import Registry
from services.runtime.os import system
from tools.ask import dive_in
from tools.checks import pilot_of
from tools.choices import Choices, Overrides, RunningDive
from tools.start import settled

SERVICE = "ros2"
LOOK_S = 0.5  # [s] between two looks whether the dive goes on


def ros2(*, dive: RunningDive = None, set_: Overrides = ()) -> int:
    """Show a running dive in ROS 2, and have it flown from there.

    It has the vehicle file and the settings of the dive. It reaches the ROS network by the router
    of rmw_zenoh, which --set ros2.router=tcp/HOST:7447 names. It takes sticks only with --set
    ros2.sticks=true: whoever reaches that router may then fly. It ends with the dive, or with
    Ctrl-C.

    Example: lindy ros2 --set ros2.domain=3
    """
    running = dive_in(dive)
    if SERVICE in running.pids:
        raise LindyError(f"the dive of {running.vehicle} is in ROS 2 already, by its stack file")
    services = Registry.read(SERVICE)
    spec = services[SERVICE]
    spec = replace(spec, sides=[side for side in spec.sides if side in running.endpoints])
    here = services.only({SERVICE: spec})
    settings = (*running.overrides, *set_)
    choices = Choices(vehicle=running.vehicle_file or "pioneer", stack=SERVICE, set_=settings)
    out = str(Path().resolve())
    stack = settled(choices, pilot_of("gamepad"), services, here, out=out)
    threading.Thread(target=_end_with, args=(running,), daemon=True).start()
    with tempfile.TemporaryDirectory(prefix="lindy-") as checkpoint:
        return run_services(
            Launch(
                process=SERVICE,
                services={SERVICE: spec},
                stack=replace(stack, name=running.vehicle),
                stack_file=str(services.file),
                endpoints=running.endpoints,
                checkpoint=checkpoint,
            )
        )


def _end_with(running: Running) -> None:
    """End this process as Ctrl-C does when the dive's has ended."""
    ended = threading.Event()
    while not ended.wait(LOOK_S):
        if not system.exists(running.supervisor):
            os.kill(os.getpid(), signal.SIGTERM)
            return
