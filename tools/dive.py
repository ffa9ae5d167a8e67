"""`lindy dive`: the whole stack as processes on this machine, piloted, recorded and summed up."""

import os
from typing import Annotated

from cyclopts import Parameter

from services.runtime.hosts.registry import Registry
from services.runtime.launch.process_plan import Dive
from tools.choices import NAMED, Grouped, Insecure, KeysFolder, NamedChoices
from tools.keys.credentials import credentials
from tools.live.cockpit import COCKPIT, announce, with_cockpit
from tools.live.outcome import title
from tools.live.pilots import tell_who_flies, who_flies
from tools.start import as_it_can_run, fly_planned, settled


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
