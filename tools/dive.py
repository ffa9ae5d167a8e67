"""`lindy dive`: the whole stack as processes on this machine, piloted, recorded and summed up."""

import os
from pathlib import Path
from socket import gethostname

import msgspec

from services.runtime.hosts.registry import Registry
from services.runtime.launch.local_stack import local_stack
from tools.checks import checked
from tools.choices import Choices
from tools.fleet.names import own_name
from tools.keys.door import door
from tools.live.cockpit import COCKPIT, announce, with_cockpit
from tools.live.display import display
from tools.live.dive_folder import out_folder, point_latest, require_room_for_recording
from tools.live.monitor_loop import followed_by
from tools.live.outcome import RECORDER, Outcome, title
from tools.live.piloted_dive import PilotedDive, tell_who_flies, who_flies
from tools.live.stop_signals import StopSignals
from tools.live.viewer import runnable
from tools.packages import require_packages


def dive(
    choices: Choices,
    *,
    headless: bool,
    listen: str | None,
    cockpit: bool = False,
    grouped: bool = False,
    keys: Path | None = None,
    insecure: bool = False,
) -> int:
    """Returns the exit status: 0 clean, 3 done but data or a service was lost.

    Raises:
        LindyError: a wrong setting, or the dive was aborted.
    """
    way_in = None
    if listen is not None:  # to other programs this machine is the drone
        way_in = door(listen, "--listen", ("drone",), keys, insecure=insecure)
    services = runnable(Registry.read(choices.stack))
    if cockpit:
        services = with_cockpit(services, choices.pilot)
    if grouped:
        services = services.grouped()
    pilot = who_flies(choices, services)
    viewer = not headless and bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())
    services.require_whole()
    stack = checked(choices, pilot, services)
    require_packages(services, pilot.name)
    stack = msgspec.structs.replace(stack, viewer=viewer, out=str(out_folder(choices.out)))
    stack = msgspec.structs.replace(stack, insecure=insecure and listen is not None)
    name = stack.name or own_name(stack.vehicle_name, gethostname())
    stack = msgspec.structs.replace(stack, name=name)
    if RECORDER in services:
        require_room_for_recording(stack.out_dir)
    outcome = Outcome(stack)
    tell_who_flies(choices, pilot)
    print(f"{title(stack)} → {stack.out_dir}", flush=True)
    if COCKPIT in services:
        announce(stack, browser=viewer and cockpit)
    with StopSignals() as stop:
        with (
            display() as shown,
            outcome.of_the_dive(),
            local_stack(stack, services, listen, door=way_in) as local,
            followed_by(outcome, local),
        ):
            point_latest(stack.out_dir)
            outcome.exit = PilotedDive(local, pilot, choices.seconds, stop, shown).fly()
        return stop.report(outcome.sum_up)
