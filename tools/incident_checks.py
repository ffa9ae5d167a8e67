"""Checks the incidents of a stick log before the dive: what the simulator or the tether would
refuse, and incidents that nobody in this stack could carry out."""

from collections.abc import Sequence

from messages.link import LinkRequest
from messages.simulator import FaultRequest
from services.gamepad.stick_log import in_words
from services.marine.vehicle import Vehicle
from services.piloting.sticks import Incident
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.simulator.core import Settings, sensors_of
from services.simulator.faults import refusal
from services.tether.io.profile_file import asked_for, named
from tools.link_fit import why_not_flown

SIMULATOR, TETHER = "simulator", "tether"


def check_incidents(incidents: Sequence[Incident], stack: Stack, services: Registry) -> None:
    """
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
    sensors = sensors_of(stack.section(SIMULATOR, Settings))
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
