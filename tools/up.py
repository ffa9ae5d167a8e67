"""`lindy up`: one side of a dive on this machine, the other side on another one."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from services.runtime.bus.endpoint import checked_endpoint
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry, ServiceSpec
from services.runtime.launch.local_stack import LocalStack, OtherSide, local_stack
from tools.checks import DEFAULT_PILOT, checked, pilot_of
from tools.choices import Choices
from tools.live.display import Display, display
from tools.live.dive_folder import out_folder, point_latest
from tools.live.dive_timeline import DiveTimeline
from tools.live.monitor_loop import MonitorLoop, told
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
    resume: Path | None = None,
) -> int:
    """Returns the exit status: 0 clean, 3 done but data was lost.

    Raises:
        LindyError: something is set wrongly, a service cannot start, or the dive ended before its
            time.
    """
    if side not in OTHER:
        raise LindyError(f"unknown side {side!r}{nearest(side, list(OTHER))}")
    if side == "drone":
        return drone(choices, checked_endpoint(listen, "--listen"), resume)
    if resume is not None:
        raise LindyError(
            "--resume is for the drone: only on board there is something to go on with"
        )
    return topside(choices, checked_endpoint(connect, "--connect"), gateway)


def drone(choices: Choices, listen: str, resume: Path | None) -> int:
    """Until Ctrl-C: on board everything goes on, whether or not the topside is there."""
    every = Registry.read(choices.stack)
    here = on_side(every, "drone", gateway=False)
    stack = checked(choices, pilot_of(choices.pilot or DEFAULT_PILOT), every, here)
    before = resumed(resume, time.monotonic_ns(), time.time()) if resume is not None else {}
    # Who has the sticks, and what the link is like, is the topside's affair.
    stack = msgspec.structs.replace(stack, apart=True, pilot=OTHER["drone"], link=listen)
    stack = msgspec.structs.replace(stack, out=str(out_folder(choices.out)))
    print(f"drone {stack.vehicle}, for the topside at {listen} → {stack.out_dir}", flush=True)
    print(f"vehicle side: {in_words(here.vehicle_side)}", flush=True)

    def go(local: LocalStack, stop: StopSignals, shown: Display) -> str:
        return MonitorLoop(local, DiveTimeline(None, choices.seconds), stop, shown).keep()

    return run(stack, every, here, OtherSide("drone", listen=(listen,)), go, before)


def topside(choices: Choices, connect: str, gateway: bool) -> int:
    """A dive as `lindy dive` flies it; what is recorded is recorded on board."""
    every = Registry.read(choices.stack)
    here = runnable(on_side(every, "topside", gateway=gateway))
    pilot = who_flies(choices)
    stack = checked(choices, pilot, every, here)
    stack = msgspec.structs.replace(stack, apart=True, out=str(out_folder(choices.out)))
    # Either the two hubs are joined, or the tether process stands between them.
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

    return run(stack, every, here, other_side, go)


def run(
    stack: Stack,
    every: Registry,
    here: Registry,
    other_side: OtherSide,
    go: Go,
    begin_with: Mapping[str, bytes] | None = None,
) -> int:
    """One side of a stack from its start to its last words. Returns the exit status."""
    outcome = Outcome(stack)
    with (
        StopSignals() as stop,
        display() as shown,
        outcome.of_the_dive(),
        local_stack(stack, here, other_side=other_side, begin_with=begin_with) as local,
        told(outcome, local),
    ):
        point_latest(stack.out_dir)
        outcome.exit = go(local, stop, shown)
    other = OTHER[other_side.side]
    if RECORDER in here:
        return outcome.sum_up(Elsewhere(other, tuple(on_side(every, other, gateway=False))))
    return outcome.sum_up_unrecorded(other_side.side, other)


def on_side(every: Registry, side: str, *, gateway: bool) -> Registry:
    """The services whose home is on this side; they hear no other side but through the link."""
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
