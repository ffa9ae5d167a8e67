"""`lindy up`: one side of a dive on this machine, while the other side runs on another machine."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, NoReturn

import msgspec

from services.runtime.bus.key_files import Door
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.local_stack import OtherSide, local_stack, require_free
from tools.checks import DEFAULT_PILOT, PilotChoice, checked, pilot_of, require_mavlink
from tools.choices import Choices
from tools.keys.door import door
from tools.live.display import display
from tools.live.dive_folder import (
    hand_over,
    out_folder,
    point_latest,
    require_room_for_recording,
)
from tools.live.monitor_loop import followed_by
from tools.live.outcome import RECORDER, Outcome
from tools.live.piloted_dive import PilotedDive, tell_who_flies, who_flies
from tools.live.resume import ESTIMATION, resumed
from tools.live.stop_signals import StopSignals
from tools.live.viewer import runnable
from tools.onboard.broken_off import broken_off
from tools.onboard.plan import Plan, become
from tools.onboard.this_start import NOTE, Start, boot_id
from tools.report import Elsewhere

OTHER = {"topside": "drone", "drone": "topside"}
HERE = "tcp/127.0.0.1:7447"  # where both sides meet on one machine
RECORDER_HERE = f"{RECORDER}_topside"  # records what the topside hears
GATEWAY = "tether"  # the service that may stand between the two


def up(
    side: str,
    choices: Choices,
    *,
    listen: str | None,
    connect: str | None,
    gateway: bool,
    grouped: bool,
    resume: Path | None = None,
    keys: Path | None = None,
    insecure: bool = False,
) -> int:
    """Returns the exit status: 0 clean, 3 done but data or a service was lost.

    Raises:
        LindyError: a wrong setting, a service cannot start, or the dive was aborted.
    """
    if side not in OTHER:
        raise LindyError(f"unknown side {side!r}{nearest(side, list(OTHER))}")
    if side == "drone":
        if connect is not None:
            raise LindyError(
                f"--connect is for the topside: the drone waits for it, with --listen {connect}"
            )
        listen = HERE if listen is None else listen
        way_in = door(listen, "--listen", ("drone",), keys, insecure=insecure)
        return drone(choices, listen, resume, way_in, grouped=grouped, insecure=insecure)
    if resume is not None:
        raise LindyError(
            "--resume is for the drone: only on board there is something to go on with"
        )
    if listen is not None:
        raise LindyError(
            f"--listen is for the drone: the topside calls it, with --connect {listen}"
        )
    connect = HERE if connect is None else connect
    way_out = door(connect, "--connect", ("pilot",), keys, insecure=insecure)
    return topside(choices, connect, way_out, gateway=gateway, grouped=grouped, insecure=insecure)


def drone(
    choices: Choices,
    listen: str,
    resume: Path | None,
    way_in: Door | None,
    *,
    grouped: bool,
    insecure: bool,
) -> NoReturn:
    """Run the drone's side until Ctrl-C, whether or not the topside is connected. This program only
    checks and plans: a smaller one takes its place."""
    every = Registry.read(choices.stack)
    here = on_side(every, "drone", gateway=False)
    here = here.grouped() if grouped else here
    stack = checked(choices, pilot_of(choices.pilot or DEFAULT_PILOT), every, here)
    require_mavlink(here)
    before = resumed(resume, time.monotonic_ns(), time.time()) if resume is not None else {}
    # The pilot and the link are chosen on the topside.
    stack = msgspec.structs.replace(stack, apart=True, pilot=OTHER["drone"], link=listen)
    stack = msgspec.structs.replace(stack, read_besides=[])  # they are the pilot's and the link's
    stack = msgspec.structs.replace(stack, out=str(out_folder(choices.out)), insecure=insecure)
    print(f"drone {stack.vehicle}, for the topside at {listen} → {stack.out_dir}", flush=True)
    print(f"vehicle side: {in_words(here.vehicle_side)}", flush=True)
    if RECORDER in here:
        require_room_for_recording(stack.out_dir)
    require_free(listen, stack, way_in)
    plan = Plan(
        stack=stack,
        stack_file=str(here.file),
        services=dict(here),
        elsewhere=tuple(on_side(every, "topside", gateway=False)),
        listen=listen,
        door=way_in,
        begin_with={**goes_on_with(stack), **before},
        seconds=choices.seconds,
        claim=hand_over(stack.out_dir),
    )
    become("supervise", plan)


def goes_on_with(stack: Stack) -> dict[str, bytes]:
    """The files that the folder of the checkpoints begins with: a note of this start, and the
    estimator's checkpoint of a dive that broke off, which is announced."""
    boot, now = boot_id(), time.monotonic_ns()
    if boot is None:
        return {}
    start = {NOTE: msgspec.json.encode(Start(boot, stack.vehicle_name, now))}
    before = broken_off(stack.out_dir.parent, boot, stack.vehicle_name, now)
    if before is None:
        return start
    print(
        f"goes on with the calibration of {before.folder}, which broke off; it is "
        f"{before.age_s:.0f} s old",
        flush=True,
    )
    return {**start, ESTIMATION: before.checkpoint}


def topside(
    choices: Choices,
    connect: str,
    way_out: Door | None,
    *,
    gateway: bool,
    grouped: bool,
    insecure: bool,
) -> int:
    """The topside of a dive as in `lindy dive`; the report is made on board."""
    every = Registry.read(choices.stack)
    here = runnable(on_side(every, "topside", gateway=gateway))
    here = here.grouped() if grouped else here
    pilot = who_flies(choices, here)
    stack = checked(choices, pilot, every, here)
    require_mavlink(here)
    stack = msgspec.structs.replace(stack, apart=True, insecure=insecure)
    stack = msgspec.structs.replace(stack, out=str(out_folder(choices.out)))
    # Either the two hubs are connected, or the tether service forwards between them.
    other_side = (
        OtherSide("topside", gateway=connect)
        if gateway
        else OtherSide("topside", connect=(connect,))
    )
    way = f"{stack.link} at {connect}" if gateway else connect
    tell_who_flies(choices, pilot)
    print(f"topside of {stack.vehicle}, drone by way of {way} → {stack.out_dir}", flush=True)

    return run(stack, every, here, other_side, Piloting(pilot, choices.seconds), way_out)


class Piloting(NamedTuple):
    """Who flies, and for how long."""

    pilot: PilotChoice
    seconds: float | None  # [s] after arming; None: until the script or the user ends it


def run(
    stack: Stack,
    every: Registry,
    here: Registry,
    other_side: OtherSide,
    piloting: Piloting,
    keys: Door | None,
) -> int:
    """The topside from its start to its summary. Returns the exit status."""
    if RECORDER in here or RECORDER_HERE in here:
        require_room_for_recording(stack.out_dir)
    outcome = Outcome(stack)
    with StopSignals() as stop:
        with (
            display() as shown,
            outcome.of_the_dive(),
            local_stack(stack, here, other_side=other_side, door=keys) as local,
            followed_by(outcome, local),
        ):
            point_latest(stack.out_dir)
            outcome.exit = PilotedDive(local, *piloting, stop, shown).fly()
        if RECORDER in here:
            drone = Elsewhere("drone", tuple(on_side(every, "drone", gateway=False)))
            return stop.report(lambda: outcome.sum_up(drone))
        return stop.report(
            lambda: outcome.sum_up_unrecorded("topside", "drone"),
            "the report is on the drone's side",
        )


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
