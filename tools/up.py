"""`lindy up` and `lindy fly`: one side of a dive on this machine, while the other side runs on
another machine."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import msgspec
from cyclopts import Parameter

from services.runtime.bus.access_control import Credentials
from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.local_stack import require_free
from services.runtime.launch.process_plan import Dive
from services.runtime.os import system
from tools.checks import DEFAULT_PILOT, PilotChoice, pilot_of
from tools.choices import (
    FLEET,
    HERE,
    NAMED,
    Choices,
    FleetChoices,
    Grouped,
    Insecure,
    KeysFolder,
    NamedChoices,
    Router,
)
from tools.fleet.network import (
    Meeting,
    drone_at,
    drones_credentials,
    drones_name,
    missing,
    require_only,
    wanted_at,
    who_is_there,
)
from tools.keys.credentials import credentials
from tools.live.cockpit import COCKPIT, announce
from tools.live.outcome import RECORDER
from tools.live.pilots import tell_who_flies, who_flies
from tools.live.resume import begin_with
from tools.start import RECORDER_HERE, as_it_can_run, fly_planned, keep_on_board, own, settled

OTHER = {"topside": "drone", "drone": "topside"}
GATEWAY = "tether"  # the service that may stand between the two


def up(
    side: str,
    /,
    *,
    listen: Annotated[
        str | None,
        Parameter(
            help=f"drone: endpoint for the topside, e.g. tls/192.168.2.2:7447; default {HERE}"
        ),
    ] = None,
    connect: Annotated[
        str | None,
        Parameter(
            name=("--connect", "--router"),
            help="topside: endpoint of the drone, e.g. tls/192.168.2.2:7447; either side: of a "
            f"Zenoh router where both meet, see docs/fleet.md; default for the topside {HERE}",
        ),
    ] = None,
    gateway: Annotated[
        bool, Parameter(help="topside: add the emulated link (--link) to the real one")
    ] = False,
    resume: Annotated[
        Path | None,
        Parameter(
            help="drone: folder of the dive that a power cut ended; goes on with its calibration"
        ),
    ] = None,
    grouped: Grouped = False,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    choices: NamedChoices = NAMED,
) -> int:
    """Start one SIDE of a dive, topside or drone, on this machine.

    The other side runs on another. Start the drone first. Each side has its own clock; the clock
    offset is measured. By default both connect on this machine. Between machines both need keys:
    see `lindy keys`. A topside without --name takes the one drone that can be reached. Exit status
    3: data was lost, or a service did not work for a while.

    Example: lindy up drone --listen tls/192.168.2.2:7447
             lindy up topside --connect tls/192.168.2.2:7447
    """
    if side not in OTHER:
        raise LindyError(f"unknown side {side!r}{nearest(side, list(OTHER))}")
    if side == "drone":
        if system.WINDOWS:
            raise LindyError(
                "`lindy up drone` needs Linux or macOS; this computer can be the topside: "
                "lindy up topside"
            )
        listen = HERE if listen is None and connect is None else listen
        way_in = drones_credentials(listen, connect, keys, insecure=insecure)
        meeting = Meeting(listen, connect, way_in)
        return drone(choices, meeting, resume, grouped=grouped, insecure=insecure)
    if resume is not None:
        raise LindyError(
            "--resume is for the drone: only on board there is something to go on with"
        )
    if listen is not None:
        raise LindyError(
            f"--listen is for the drone: the topside calls it, with --connect {listen}"
        )
    connect = connect or HERE
    way_out = credentials(connect, "--connect", ("pilot",), keys, insecure=insecure)
    return fly_planned(
        *topside(choices, connect, way_out, gateway=gateway, grouped=grouped, insecure=insecure)
    )


def fly(
    drone: str,
    /,
    *,
    router: Router = HERE,
    grouped: Grouped = False,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    choices: FleetChoices = FLEET,
) -> int:
    """Start the topside for one of several drones.

    `lindy drones` lists the names. `lindy up topside --router ENDPOINT --name DRONE` does the same,
    and also waits for the drone. Exit status 3: data was lost, or a service did not work for a
    while.

    Example: lindy fly rov2 --router tls/192.168.2.1:7447
    """
    checked_name(drone, "fly")
    way = credentials(router, "--router", ("pilot",), keys, insecure=insecure)
    own_keys = None if way is None else way.keys
    if drone not in (there := who_is_there(router, own_keys)):
        raise LindyError(missing(drone, there, router))
    plan, pilot = topside(
        replace(choices, name=drone), router, way, grouped=grouped, insecure=insecure
    )
    if COCKPIT in plan.services:
        announce(plan.stack, browser=False)
    return fly_planned(plan, pilot)


def drone(
    choices: Choices,
    meeting: Meeting,
    resume: Path | None,
    *,
    grouped: bool,
    insecure: bool,
) -> int:
    """Run the drone's side until Ctrl-C, whether or not the topside is connected."""
    every = Registry.read(choices.stack)
    here = as_it_can_run(on_side(every, "drone", gateway=False), choices, every, grouped=grouped)
    stack = settled(
        choices,
        pilot_of(choices.pilot or DEFAULT_PILOT),
        every,
        here,
        name=lambda stack: drones_name(stack, meeting),
        apart=True,
        insecure=insecure,
        pilot=OTHER["drone"],  # it and the link are chosen on the topside
        link=meeting.link,
        read_besides=[],  # they are the pilot's and the link's
    )
    files = begin_with(stack, resume)
    print(
        f"drone {stack.drone_name} ({stack.vehicle}), for the topside at {meeting.link} → "
        f"{stack.out_dir}",
        flush=True,
    )
    print(f"vehicle side: {in_words(here.vehicle_side)}", flush=True)
    if meeting.listen is not None:
        require_free(meeting.listen, stack, meeting.credentials)
    if meeting.router is not None:
        require_only(stack.drone_name, meeting.router, meeting.keys)
    dive = Dive(
        stack,
        here,
        side="drone",
        elsewhere=tuple(on_side(every, "topside", gateway=False)),
        listen=() if meeting.listen is None else (meeting.listen,),
        connect=() if meeting.router is None else (meeting.router,),
        credentials=meeting.credentials,
        begin_with=files,
    )
    return keep_on_board(dive)


def topside(
    choices: Choices,
    connect: str,
    way_out: Credentials | None,
    *,
    gateway: bool = False,
    grouped: bool,
    insecure: bool,
) -> tuple[Dive, PilotChoice]:
    """The topside of a dive as in `lindy dive`, checked, and its pilot; the report is made on
    board.

    Raises:
        LindyError: a wrong setting.
    """
    every = Registry.read(choices.stack)
    here = on_side(every, "topside", gateway=gateway)
    here = as_it_can_run(here, choices, every, grouped=grouped)
    pilot = who_flies(choices, here, elsewhere=True)
    keys = None if way_out is None else way_out.keys

    def name(stack: Stack) -> str:
        if stack.name:
            return wanted_at(connect, stack.name, keys)
        return drone_at(connect, own(stack), keys)

    stack = settled(
        choices,
        pilot,
        every,
        here,
        name=name,
        apart=True,
        insecure=insecure,
    )
    way = f"{stack.link} at {connect}" if gateway else connect
    tell_who_flies(choices, pilot)
    print(f"topside of {stack.drone_name}, drone by way of {way} → {stack.out_dir}", flush=True)
    dive = Dive(
        stack,
        here,
        side="topside",
        elsewhere=tuple(on_side(every, "drone", gateway=False)),
        # Either the two hubs are connected, or the tether service forwards between them.
        connect=() if gateway else (connect,),
        gateway=connect if gateway else None,
        credentials=way_out,
    )
    return dive, pilot


def on_side(every: Registry, side: str, *, gateway: bool) -> Registry:
    """The services whose home is this side; they are connected to this side only. Where the stack
    has a recorder on board, the topside gets one of its own."""
    specs: dict[str, ServiceSpec] = {}
    for name, spec in every.apart().items():
        if name == GATEWAY:
            if gateway:
                specs[name] = spec
        elif spec.sides[0] == side:
            specs[name] = msgspec.structs.replace(spec, sides=[side])
        elif name == RECORDER and side == "topside":
            specs[RECORDER_HERE] = msgspec.structs.replace(
                spec, sides=[side], service=RECORDER, process=RECORDER_HERE
            )
    return every.only(specs)


def in_words(modules: Mapping[str, str]) -> str:
    """Services with their modules: `driver (my_lab.my_driver)`."""
    return ", ".join(f"{name} ({module})" for name, module in modules.items())
