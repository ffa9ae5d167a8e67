"""The one start of everything that flies: what is checked, in which order, and how it is run; and
`lindy dive`, the whole stack as processes on this machine.

`dive`, both sides of `up`, `fly`, `simulate` and `run` choose services and a pilot, and have them
`settled`. A `Dive` with a pilot on this machine is then flown by `fly_planned`; the drone's side of
one is run by `keep_on_board`.
"""

import os
from collections.abc import Callable, Collection
from contextlib import suppress
from socket import gethostname
from typing import Annotated, Any

import msgspec
from cyclopts import Parameter

from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.launch.local_stack import local_stack
from services.runtime.launch.process_plan import Dive
from tools.checks import PilotChoice, checked
from tools.choices import NAMED, Choices, Grouped, Insecure, KeysFolder, NamedChoices
from tools.fleet.network import own_name
from tools.keys.credentials import credentials
from tools.live.cockpit import (
    COCKPIT,
    announce,
    runnable,
    with_cockpit,
    with_further_cameras,
    with_picture,
)
from tools.live.dive_folder import out_folder, point_latest, require_room_for_recording
from tools.live.outcome import RECORDER, Outcome, title
from tools.live.pilots import tell_who_flies, who_flies
from tools.live.resume import mark_ended
from tools.live.screen import display
from tools.live.session import DroneSide, PilotedDive, followed_by
from tools.live.stop_signals import StopSignals
from tools.packages import lacking
from tools.report.summary import Elsewhere

RECORDER_HERE = f"{RECORDER}_topside"  # records what the topside hears


def as_it_can_run(
    services: Registry, choices: Choices, every: Collection[str] = (), *, grouped: bool
) -> Registry:
    """These services without those that this machine cannot run, which is printed.

    Args:
        every: where these are those of one side, all services of the stack.

    Raises:
        LindyError: the table [camera] is wrong, or a process has the name of a service.
    """
    services = with_picture(runnable(services), choices, every)
    services = with_further_cameras(services, choices)
    return services.grouped() if grouped else services


def as_given(stack: Stack) -> str:
    """Name of a drone in virtual time: its type's, where it was given none."""
    return stack.name


def own(stack: Stack) -> str:
    """Name of a drone of this machine: the one that it was given, else by its computer."""
    return stack.name or own_name(stack.vehicle_name, gethostname())


def settled(
    choices: Choices,
    pilot: PilotChoice,
    services: Registry,
    here: Registry | None = None,
    /,
    *,
    name: Callable[[Stack], str] = own,
    **settings: Any,
) -> Stack:
    """What every service of a dive shares, after every possible check; and its folder, unless `out`
    names one.

    Args:
        here: of the services those of this machine; None: all.
        name: the drone's, where none was given.
        settings: other fields of the stack.

    Raises:
        LindyError: the first mistake found, a package is missing, or nothing can be written.
    """
    if names := foreign(services):  # said before anything of it is imported
        print(f"{services.file} runs code that is not Lindy's own: {', '.join(names)}", flush=True)
    stack = checked(choices, pilot, services, here)
    if (why := lacking(services if here is None else here, pilot.name)) is not None:
        raise LindyError(why)
    stack = msgspec.structs.replace(stack, **settings)
    stack = msgspec.structs.replace(stack, name=name(stack))
    if "out" not in settings:
        stack = msgspec.structs.replace(stack, out=str(out_folder(choices.out)))
        require_room(stack, services if here is None else here)
    return stack


def foreign(services: Registry) -> list[str]:
    """Services whose code is not Lindy's own, with the module of each."""
    specs = services.items()
    return [f"{name} (module {spec.module})" for name, spec in specs if spec.module is not None]


def require_room(stack: Stack, here: Registry) -> None:
    """Raises LindyError: the recorder of this machine could not begin in the dive's folder."""
    if RECORDER in here or RECORDER_HERE in here:
        require_room_for_recording(stack.out_dir)


def fly_planned(dive: Dive, pilot: PilotChoice) -> int:
    """From the start of the hubs to the summary. Returns the exit status.

    Raises:
        LindyError: the dive was aborted.
    """
    outcome, left = Outcome(dive.stack), ""
    with StopSignals() as stop:
        with (
            display() as shown,
            outcome.of_the_dive(),
            local_stack(dive) as local,
            followed_by(outcome, local),
        ):
            point_latest(dive.stack.out_dir)
            piloted = PilotedDive(local, pilot, stop, shown)
            outcome.exit = piloted.fly()
            outcome.stopped, left = stop.asked, piloted.left
        if left:  # once the screen is gone
            print(left, flush=True)
        return _sum_up(dive, outcome, stop, "the report is on the drone's side")


def keep_on_board(dive: Dive) -> int:
    """The drone's side, from the start of its hub to the summary, with lines in place of a screen.
    Returns the exit status.

    Raises:
        LindyError: the dive was aborted.
    """
    outcome = Outcome(dive.stack)
    with StopSignals() as stop:
        with outcome.of_the_dive(), local_stack(dive) as local, followed_by(outcome, local):
            point_latest(dive.stack.out_dir)
            outcome.exit = DroneSide(local, stop).keep()
            outcome.stopped = stop.asked
            with suppress(OSError):  # it ends anyway
                mark_ended(local.plan.checkpoints)
        return _sum_up(dive, outcome, stop, "the recording is on the topside's side")


def _sum_up(dive: Dive, outcome: Outcome, stop: StopSignals, elsewhere: str) -> int:
    """`elsewhere`: what is left on the other side if this one records nothing and is broken off."""
    if dive.side is None:
        return stop.report(outcome.sum_up)
    other = "drone" if dive.side == "topside" else "topside"
    if RECORDER in dive.services:
        return stop.report(lambda: outcome.sum_up(Elsewhere(other, dive.elsewhere)))
    return stop.report(lambda: outcome.sum_up_unrecorded(str(dive.side), other), elsewhere)


def dive(
    *,
    choices: NamedChoices = NAMED,
    headless: Annotated[
        bool, Parameter(help="no live viewer, even where there is a display")
    ] = False,
    listen: Annotated[
        str | None,
        Parameter(help="endpoint for other programs on the topside, e.g. tcp/127.0.0.1:7447"),
    ] = None,
    cockpit: Annotated[
        bool,
        Parameter(
            help="fly in a browser: prints the page's address, and opens it where there is a "
            "display; with --pilot it is beside that pilot",
        ),
    ] = False,
    grouped: Grouped = False,
    keys: KeysFolder = None,
    insecure: Insecure = False,
) -> int:
    """Fly a dive on this machine: every service, record and report.

    Exit status 3: data was lost, or a service did not work for a while.

    Example: lindy dive --pilot script:first_dive --link remote --out dives/first
             lindy dive --stack real --set driver.port=/dev/ttyACM0
    """
    way_in = None
    if listen is not None:  # to other programs this machine is the drone
        way_in = credentials(listen, "--listen", ("drone",), keys, insecure=insecure)
    every = Registry.read(choices.stack)
    if cockpit:
        every = with_cockpit(every, choices.pilot)
    here = as_it_can_run(every, choices, grouped=grouped)
    pilot = who_flies(choices, here)
    here.require_whole()
    viewer = not headless and bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())
    insecure = insecure and listen is not None
    stack = settled(choices, pilot, here, viewer=viewer, insecure=insecure)
    plan = Dive(stack, here, listen=() if listen is None else (listen,), credentials=way_in)
    tell_who_flies(choices, pilot)
    print(f"{title(stack)} → {stack.out_dir}", flush=True)
    if COCKPIT in here:
        announce(stack, browser=viewer and cockpit)
    return fly_planned(plan, pilot)
