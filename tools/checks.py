"""Everything that can be checked before a dive starts, so that a mistake is reported at once; and
the files that its recording must carry, so that the dive can be flown again."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from messages.events import Outbox
from messages.link import LinkRequest
from messages.pilot import Course
from messages.simulator import FaultRequest
from services.control.core import Controller, Settings
from services.gamepad import stick_log
from services.gamepad.core import Settings as GamepadSettings
from services.gamepad.io.path_file import course_named
from services.gamepad.io.sources import pad_profile
from services.gamepad.stick_log import in_words
from services.marine.vehicle import Vehicle
from services.piloting.pilot_intents import FollowIntent
from services.piloting.sticks import Incident
from services.reference.guidance.path_following import PlannedPath
from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY, deploy_file, kept, nearest
from services.runtime.config.stack import BODY, SCRIPT, SENSORS, NamedSensors, Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import bases
from services.simulator.core import Settings as SimulatorSettings
from services.simulator.core import sensors_of
from services.simulator.faults import refusal
from services.tether.io.profile_file import asked_for, named, traces
from tools.choices import Choices
from tools.link_fit import check_can_be_flown, why_not_flown

DEFAULT_PILOT = "script:first_dive"
LONGEST_S = 86_400.0  # [s] a day
SIMULATOR, TETHER = "simulator", "tether"
LEAST_ACCELERATION = 0.05  # [m/s²] all thrusters at their limits; those shipped have 2.3 and more


@dataclass(frozen=True, slots=True)
class PilotChoice:
    """The pilot, checked."""

    name: str  # as services read it: gamepad, keyboard or script:FILE
    script_s: float | None = None  # [s] length of the script; None: a person
    incidents: tuple[Incident, ...] = ()  # of the script, in their order
    courses: tuple[str, ...] = ()  # names of the paths in it


def pilot_of(choice: str) -> PilotChoice:
    """Check `--pilot`, and read the script if it is one.

    Raises:
        LindyError: no such pilot or script, or a mistake in the script with its line.
    """
    kind, colon, name = choice.partition(":")
    if choice in ("gamepad", "keyboard"):
        return PilotChoice(choice)
    if kind != "script" or not colon or not name:
        known = ["gamepad", "keyboard", "script:FILE"]
        known += [f"script:{file.stem}" for file in sorted((DEPLOY / "dives").glob("*.csv"))]
        raise LindyError(f"unknown pilot {choice!r}{nearest(choice, known)}")
    path = deploy_file("dives", name, ".csv")
    courses: list[str] = []

    def course(wanted: str) -> Course:
        courses.append(wanted)
        return course_named(wanted)

    try:
        log = stick_log.parse(kept(path).read_bytes(), course)
        for row in log.rows:
            if isinstance(row.event, FollowIntent):
                PlannedPath(row.event.course)  # do the turns fit?
    except OSError as error:
        raise LindyError(f"cannot read {path}: {error.strerror}") from None
    except ValueError as error:
        raise LindyError(f"{path}: {error}") from None
    incidents = tuple(row.event for row in log.rows if isinstance(row.event, Incident))
    script = f"script:{path if name.endswith('.csv') else name}"
    return PilotChoice(script, log.duration, incidents, tuple(dict.fromkeys(courses)))


def checked(
    choices: Choices, pilot: PilotChoice, services: Registry, here: Collection[str] | None = None
) -> Stack:
    """The choices as the services' `Stack`, after every possible check.

    Args:
        here: names of the services that run on this machine; None: all.

    Raises:
        LindyError: the first mistake found, in one sentence.
    """
    seconds = choices.seconds
    if seconds is not None and not 0.0 < seconds <= LONGEST_S:
        raise LindyError(f"--seconds is {seconds:g}, expected more than 0, at most {LONGEST_S:g}")
    if choices.seed < 0:
        raise LindyError(f"--seed is {choices.seed}, expected 0 or more")
    stack = Stack(
        vehicle=choices.vehicle,
        name="" if choices.name is None else checked_name(choices.name, "--name"),
        link=choices.link,
        pilot=pilot.name,
        seed=choices.seed,
        overrides=list(choices.set_),
        services=choices.stack,
        watched=services.watched,
        running=list(services),
        seconds=seconds,
    )
    stack.check(known_tables(services, here, stack.tables))
    check_can_be_flown(named(choices.link))
    _submergible(stack)
    check_incidents(pilot.incidents, stack, services)
    if (control := services.get("control")) is not None and control.module is None:
        _controllable(stack)
    hands = services.get("gamepad") if pilot.script_s is None else None
    if hands is not None and hands.module is None:
        pad_profile(stack)
    besides = read_besides(stack, pilot.incidents, pilot.courses)
    return msgspec.structs.replace(stack, read_besides=besides)


def known_tables(
    services: Registry, here: Collection[str] | None = None, named: Collection[str] | None = None
) -> dict[str, type | None]:
    """The tables of a vehicle file: the vehicle itself, its sensors, and one for each service.

    Raises:
        LindyError: a module of the stack cannot be used.
    """
    return {BODY: Vehicle, SENSORS: NamedSensors, **services.tables(here, named)}


def _controllable(stack: Stack) -> None:
    """Check that the controller accepts this vehicle with these gains."""
    try:
        Controller(stack.section("control", Settings), stack.section("vehicle", Vehicle), Outbox())
    except ValueError as error:
        raise LindyError(f"{stack.vehicle_path}: {error}") from None


def _submergible(stack: Stack) -> None:
    """Check that the thrusters can hold the vehicle under water, keep it from sinking and move it:
    in grams its mass would be a thousand times as large."""
    vehicle = stack.section(BODY, Vehicle)
    push = sum(max(map(abs, thruster.limits)) for thruster in vehicle.thruster)
    if push < vehicle.mass * LEAST_ACCELERATION:
        raise stack.mistake(
            (BODY, "mass"),
            f"is {vehicle.mass:g} kg, which thrusters of {push:.0f} N in all hardly move; expected "
            f"less than {push / LEAST_ACCELERATION:.0f} kg",
        )
    up, down = vehicle.vertical_thrust
    if not min(up, down):
        raise stack.mistake(
            (BODY, "thruster"),
            "no thruster drives heave: none has a direction with a part along z, such as [0, 0, 1]",
        )
    most, way = (down, "down") if vehicle.net_buoyancy > 0.0 else (up, "up")
    if abs(vehicle.net_buoyancy) >= most and vehicle.net_buoyancy:
        raise stack.mistake(
            (BODY, "net_buoyancy"),
            f"is {vehicle.net_buoyancy:g} N, but the thrusters push {way} with at most {most:.1f} N"
            f"; expected less than that",
        )


def check_incidents(incidents: Sequence[Incident], stack: Stack, services: Registry) -> None:
    """What the simulator or the tether would refuse of a stick log, or nobody in this stack could
    carry out.

    Raises:
        LindyError: the first that cannot be carried out, and why.
    """
    faults = [incident for incident in incidents if isinstance(incident, FaultRequest)]
    links = [incident for incident in incidents if isinstance(incident, LinkRequest)]
    for who, asked in ((SIMULATOR, faults), (TETHER, links)):
        if asked and who not in services:
            raise LindyError(f"{_at(stack, asked[0])}: the stack {services.file} has no {who}")
    if faults:
        _check_faults(faults, stack)
    if links:
        _check_links(links, stack)


def _check_faults(faults: Sequence[FaultRequest], stack: Stack) -> None:
    names = [thruster.name for thruster in stack.section("vehicle", Vehicle).thruster]
    sensors = sensors_of(stack.section(SIMULATOR, SimulatorSettings))
    for fault in faults:
        if why := refusal(fault, names, sensors, nearest):
            raise LindyError(f"{_at(stack, fault)}: {why}")


def _check_links(links: Sequence[LinkRequest], stack: Stack) -> None:
    """Each on top of those before it."""
    in_force = named(stack.link)
    for request in links:
        if request.kind in ("down", "up"):
            continue
        found = asked_for(request, in_force)
        if isinstance(found, str):
            raise LindyError(f"{_at(stack, request)}: {found}")
        in_force, _ = found
        if request.kind == "profile" and (why := why_not_flown(in_force)):
            raise LindyError(f"{_at(stack, request)}: {why}")


def _at(stack: Stack, incident: Incident) -> str:
    return f"--pilot {stack.pilot}: {in_words(incident)}"


def read_besides(stack: Stack, incidents: Sequence[Incident], courses: Sequence[str]) -> list[str]:
    """The stacks that the stack extends, traces of the link, the pad profile, and the links and
    paths that a script names.

    Args:
        incidents: of the script.
        courses: names of the paths in it.
    """
    return [*dict.fromkeys(map(str, _named(stack, incidents, courses)))]


def _named(stack: Stack, incidents: Sequence[Incident], courses: Sequence[str]) -> Iterator[Path]:
    yield from bases(deploy_file("stacks", stack.services))
    yield from _traces(stack.link)
    for incident in incidents:
        if isinstance(incident, LinkRequest) and incident.profile is not None:
            with suppress(LindyError):  # the tether will refuse it
                yield deploy_file("links", incident.profile)
            yield from _traces(incident.profile)
    for course in courses:
        yield deploy_file("paths", course)
    if not stack.pilot.startswith(SCRIPT):
        with suppress(LindyError):  # the service says what is wrong with it
            yield deploy_file("pads", stack.section("gamepad", GamepadSettings).profile)


def _traces(link: str) -> list[Path]:
    with suppress(LindyError):
        return traces(named(link))
    return []
