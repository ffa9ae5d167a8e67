"""`lindy up`: one side of a dive on this machine, while the other side runs on another machine."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from services.runtime.bus.key_files import Door
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.local_stack import LocalStack, OtherSide, local_stack
from tools.checks import DEFAULT_PILOT, checked, pilot_of
from tools.choices import Choices
from tools.keys.door import door
from tools.live.display import Display, display
from tools.live.dive_folder import out_folder, point_latest, require_room_for_recording
from tools.live.dive_timeline import DiveTimeline
from tools.live.monitor_loop import MonitorLoop, followed_by
from tools.live.outcome import RECORDER, Outcome
from tools.live.piloted_dive import PilotedDive, tell_who_flies, who_flies
from tools.live.resume import resumed
from tools.live.stop_signals import StopSignals
from tools.live.viewer import runnable
from tools.report import Elsewhere

OTHER = {"topside": "drone", "drone": "topside"}
GATEWAY = "tether"  # the service that may stand between the two

Go = Callable[[LocalStack, StopSignals, Display], str]


def up(
    side: str,
    choices: Choices,
    *,
    listen: str,
    connect: str,
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
        way_in = door(listen, "--listen", ("drone",), keys, insecure=insecure)
        return drone(choices, listen, resume, way_in, grouped=grouped, insecure=insecure)
    if resume is not None:
        raise LindyError(
            "--resume is for the drone: only on board there is something to go on with"
        )
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
) -> int:
    """Run the drone's side until Ctrl-C, whether or not the topside is connected."""
    every = Registry.read(choices.stack)
    here = on_side(every, "drone", gateway=False)
    here = here.grouped() if grouped else here
    stack = checked(choices, pilot_of(choices.pilot or DEFAULT_PILOT), every, here)
    before = resumed(resume, time.monotonic_ns(), time.time()) if resume is not None else {}
    # The pilot and the link are chosen on the topside.
    stack = msgspec.structs.replace(stack, apart=True, pilot=OTHER["drone"], link=listen)
    stack = msgspec.structs.replace(stack, out=str(out_folder(choices.out)), insecure=insecure)
    print(f"drone {stack.vehicle}, for the topside at {listen} → {stack.out_dir}", flush=True)
    print(f"vehicle side: {in_words(here.vehicle_side)}", flush=True)

    def go(local: LocalStack, stop: StopSignals, shown: Display) -> str:
        return MonitorLoop(local, DiveTimeline(None, choices.seconds), stop, shown).keep()

    return run(stack, every, here, OtherSide("drone", listen=(listen,)), go, before, way_in)


def topside(
    choices: Choices,
    connect: str,
    way_out: Door | None,
    *,
    gateway: bool,
    grouped: bool,
    insecure: bool,
) -> int:
    """The topside of a dive as in `lindy dive`; the recording is made on board."""
    every = Registry.read(choices.stack)
    here = runnable(on_side(every, "topside", gateway=gateway))
    here = here.grouped() if grouped else here
    pilot = who_flies(choices, here)
    stack = checked(choices, pilot, every, here)
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

    def go(local: LocalStack, stop: StopSignals, shown: Display) -> str:
        return PilotedDive(local, pilot, choices.seconds, stop, shown).fly()

    return run(stack, every, here, other_side, go, keys=way_out)


def run(
    stack: Stack,
    every: Registry,
    here: Registry,
    other_side: OtherSide,
    go: Go,
    begin_with: Mapping[str, bytes] | None = None,
    keys: Door | None = None,
) -> int:
    """One side of a stack from its start to its summary. Returns the exit status."""
    if RECORDER in here:
        require_room_for_recording(stack.out_dir)
    outcome = Outcome(stack)
    side, other = other_side.side, OTHER[other_side.side]
    with StopSignals() as stop:
        with (
            display() as shown,
            outcome.of_the_dive(),
            local_stack(
                stack, here, other_side=other_side, begin_with=begin_with, door=keys
            ) as local,
            followed_by(outcome, local),
        ):
            point_latest(stack.out_dir)
            outcome.exit = go(local, stop, shown)
        if RECORDER in here:
            there = Elsewhere(other, tuple(on_side(every, other, gateway=False)))
            return stop.report(lambda: outcome.sum_up(there))
        return stop.report(
            lambda: outcome.sum_up_unrecorded(side, other),
            f"the recording is on the {other}'s side",
        )


def on_side(every: Registry, side: str, *, gateway: bool) -> Registry:
    """The services whose home is this side; they are connected to this side only."""
    specs: dict[str, ServiceSpec] = {}
    for name, spec in every.apart().items():
        if name == GATEWAY:
            if gateway:
                specs[name] = spec
        elif spec.sides[0] == side:
            specs[name] = msgspec.structs.replace(spec, sides=[side])
    return every.only(specs)


def in_words(modules: Mapping[str, str]) -> str:
    """Services with their modules: `driver (my_lab.my_driver)`."""
    return ", ".join(f"{name} ({module})" for name, module in modules.items())
