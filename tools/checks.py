"""Everything that can be checked before a dive starts, so that a mistake is reported at once."""

from collections.abc import Collection
from dataclasses import dataclass

import msgspec

from messages.events import Outbox
from messages.pilot import Course
from services.control.core import Controller, Settings
from services.gamepad import stick_log
from services.gamepad.io.path_file import course_named
from services.gamepad.io.sources import pad_profile
from services.marine.vehicle import Vehicle
from services.piloting.pilot_intents import FollowIntent
from services.piloting.sticks import Incident
from services.reference.guidance.path_following import PlannedPath
from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY, deploy_file, kept, nearest
from services.runtime.config.stack import BODY, SENSORS, NamedSensors, Stack
from services.runtime.hosts.registry import Registry
from services.tether.io.profile_file import named
from tools.choices import Choices
from tools.dive_files import read_besides
from tools.incident_checks import check_incidents
from tools.link_fit import check_can_be_flown

DEFAULT_PILOT = "script:first_dive"
LONGEST_S = 86_400.0  # [s] a day
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
    most, way = (down, "down") if vehicle.net_buoyancy > 0.0 else (up, "up")
    if abs(vehicle.net_buoyancy) >= most and vehicle.net_buoyancy:
        raise stack.mistake(
            (BODY, "net_buoyancy"),
            f"is {vehicle.net_buoyancy:g} N, but the thrusters push {way} with at most {most:.1f} N"
            f"; expected less than that",
        )
