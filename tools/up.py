"""`lindy up`: one side of a dive on this machine, while the other side runs on another machine."""

import time
from collections.abc import Mapping
from pathlib import Path
from socket import gethostname
from typing import NamedTuple, NoReturn

import msgspec

from services.runtime.bus.key_files import Door
from services.runtime.config.errors import LindyError
from services.runtime.config.identity import identity_now
from services.runtime.config.settings import nearest
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.local_stack import OtherSide, local_stack, require_free
from tools.checks import DEFAULT_PILOT, PilotChoice, checked, pilot_of
from tools.choices import Choices
from tools.fleet.meeting import Meeting, drone_at, drones_door, drones_name, require_only
from tools.fleet.names import own_name
from tools.fleet.others import others_named
from tools.keys.door import door
from tools.live.cockpit import with_picture
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
from tools.onboard.this_start import NOTE, Start, boot_id, other_vehicle
from tools.packages import require_packages
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
    router: str | None = None,
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
        listen = HERE if listen is None and router is None else listen
        way_in = drones_door(listen, router, keys, insecure=insecure)
        meeting = Meeting(listen, router, way_in)
        return drone(choices, meeting, resume, grouped=grouped, insecure=insecure)
    if resume is not None:
        raise LindyError(
            "--resume is for the drone: only on board there is something to go on with"
        )
    if listen is not None:
        raise LindyError(
            f"--listen is for the drone: the topside calls it, with --connect {listen}"
        )
    if connect is not None and router is not None:
        raise LindyError(f"--connect {connect} and --router {router}: one of them is enough")
    option = "--connect" if router is None else "--router"
    connect = connect or router or HERE
    way_out = door(connect, option, ("pilot",), keys, insecure=insecure)
    return topside(choices, connect, way_out, gateway=gateway, grouped=grouped, insecure=insecure)


def drone(
    choices: Choices,
    meeting: Meeting,
    resume: Path | None,
    *,
    grouped: bool,
    insecure: bool,
) -> NoReturn:
    """Run the drone's side until Ctrl-C, whether or not the topside is connected. This program only
    checks and plans: a smaller one takes its place."""
    every = Registry.read(choices.stack)
    here = with_picture(on_side(every, "drone", gateway=False), choices, every)
    here = here.grouped() if grouped else here
    stack = checked(choices, pilot_of(choices.pilot or DEFAULT_PILOT), every, here)
    require_packages(here)
    before: dict[str, bytes] = {}
    if resume is not None:
        before = resumed(resume, identity_now(stack, "drone"), time.monotonic_ns(), time.time())
    # The pilot and the link are chosen on the topside.
    stack = msgspec.structs.replace(stack, apart=True, pilot=OTHER["drone"], link=meeting.link)
    stack = msgspec.structs.replace(stack, name=drones_name(stack, meeting), insecure=insecure)
    stack = msgspec.structs.replace(stack, read_besides=[])  # they are the pilot's and the link's
    stack = msgspec.structs.replace(stack, out=str(out_folder(choices.out)))
    print(
        f"drone {stack.drone_name} ({stack.vehicle}), for the topside at {meeting.link} → "
        f"{stack.out_dir}",
        flush=True,
    )
    print(f"vehicle side: {in_words(here.vehicle_side)}", flush=True)
    if RECORDER in here:
        require_room_for_recording(stack.out_dir)
    if meeting.listen is not None:
        require_free(meeting.listen, stack, meeting.door)
    if meeting.router is not None:
        require_only(stack.drone_name, meeting.router, meeting.keys)
    plan = Plan(
        stack=stack,
        stack_file=str(here.file),
        services=dict(here),
        elsewhere=tuple(on_side(every, "topside", gateway=False)),
        listen=meeting.listen,
        router=meeting.router,
        door=meeting.door,
        begin_with={**goes_on_with(stack, resumes=bool(before)), **before},
        seconds=choices.seconds,
        claim=hand_over(stack.out_dir),
    )
    become("supervise", plan)


def goes_on_with(stack: Stack, *, resumes: bool = False) -> dict[str, bytes]:
    """The files that the folder of the checkpoints begins with: a note of this start, and the
    estimator's checkpoint of a dive that broke off, of this very vehicle, which is announced.

    Args:
        resumes: another dive to go on with was named by the user.

    Raises:
        LindyError: the vehicle file cannot be read.
    """
    boot, now, identity = boot_id(), time.monotonic_ns(), identity_now(stack, "drone")
    note = Start(
        boot_id=boot or "",
        vehicle=stack.drone_name,
        began_ns=now,
        vehicle_file=identity.vehicle,
        vehicle_hash=identity.vehicle_hash,
    )
    start = {NOTE: msgspec.json.encode(note)}
    before = None
    if boot is not None and not resumes:
        before = broken_off(stack.out_dir.parent, boot, stack.drone_name, now)
    if before is None:
        return start
    if why := other_vehicle(before.start, identity):
        print(
            f"does not go on with the calibration of {before.folder}, which broke off: {why}; "
            f"this start calibrates anew, with the vehicle afloat and at rest",
            flush=True,
        )
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
    return run(
        planned(choices, connect, way_out, gateway=gateway, grouped=grouped, insecure=insecure)
    )


class Piloting(NamedTuple):
    """Who flies, and for how long."""

    pilot: PilotChoice
    seconds: float | None  # [s] after arming; None: until the script or the user ends it


class Planned(NamedTuple):
    """A topside that was checked and can be started."""

    stack: Stack
    every: Registry
    here: Registry  # of it, the services of this side
    other_side: OtherSide
    piloting: Piloting
    keys: Door | None

    def sum_up(self, outcome: Outcome) -> int:
        """Print the summary. Returns the exit status.

        Raises:
            LindyError: why it was aborted.
        """
        if RECORDER in self.here:
            drone = Elsewhere("drone", tuple(on_side(self.every, "drone", gateway=False)))
            return outcome.sum_up(drone)
        return outcome.sum_up_unrecorded("topside", "drone")

    def require_room(self) -> None:
        """
        Raises:
            LindyError: the recorder could not begin in this folder.
        """
        if RECORDER in self.here or RECORDER_HERE in self.here:
            require_room_for_recording(self.stack.out_dir)


def planned(
    choices: Choices,
    connect: str,
    way_out: Door | None,
    *,
    gateway: bool,
    grouped: bool,
    insecure: bool,
) -> Planned:
    """
    Raises:
        LindyError: a wrong setting.
    """
    every = Registry.read(choices.stack)
    here = with_picture(runnable(on_side(every, "topside", gateway=gateway)), choices, every)
    here = here.grouped() if grouped else here
    pilot = who_flies(choices, here, elsewhere=True)
    stack = checked(choices, pilot, every, here)
    require_packages(here, pilot.name)
    stack = msgspec.structs.replace(stack, apart=True, insecure=insecure)
    own = own_name(stack.vehicle_name, gethostname())
    keys = None if way_out is None else way_out.keys
    stack = msgspec.structs.replace(stack, name=stack.name or drone_at(connect, own, keys))
    stack = msgspec.structs.replace(stack, out=str(out_folder(choices.out)))
    # Either the two hubs are connected, or the tether service forwards between them.
    other_side = (
        OtherSide("topside", gateway=connect)
        if gateway
        else OtherSide("topside", connect=(connect,))
    )
    way = f"{stack.link} at {connect}" if gateway else connect
    tell_who_flies(choices, pilot)
    print(f"topside of {stack.drone_name}, drone by way of {way} → {stack.out_dir}", flush=True)
    return Planned(stack, every, here, other_side, Piloting(pilot, choices.seconds), way_out)


def run(plan: Planned) -> int:
    """The topside from its start to its summary. Returns the exit status."""
    plan.require_room()
    outcome = Outcome(plan.stack)
    with StopSignals() as stop:
        with (
            display() as shown,
            outcome.of_the_dive(),
            local_stack(plan.stack, plan.here, other_side=plan.other_side, door=plan.keys) as local,
            followed_by(outcome, local),
            others_named(local),
        ):
            point_latest(plan.stack.out_dir)
            flown = PilotedDive(local, *plan.piloting, stop, shown)
            outcome.exit = flown.fly()
        if flown.left:
            print(flown.left, flush=True)
        if RECORDER in plan.here:
            return stop.report(lambda: plan.sum_up(outcome))
        return stop.report(lambda: plan.sum_up(outcome), "the report is on the drone's side")


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
