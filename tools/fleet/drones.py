"""`lindy drones`: who is there, at a drone's own endpoint or on a whole network."""

import json
from pathlib import Path
from typing import Any

from messages import topics
from messages.counts import short
from messages.identity import SideIdentity
from messages.sensors import BatterySample
from messages.vehicle import VehicleStatus
from services.runtime.config.identity import messages_hash
from tools.fleet.look import look
from tools.fleet.names import clean
from tools.fleet.roster import Drone, Roster
from tools.keys.door import door
from tools.keys.roles import Role

WATCHERS: tuple[Role, ...] = ("observer", "pilot")
HEADING = ("name", "type", "Lindy", "mode", "battery", "who flies", "")
UNKNOWN = "–"
SILENT = "is announced, but says nothing"
OTHER_MESSAGES = "other messages than here: cannot be flown from here"
TWICE = "two drones of this name"


def drones(
    endpoint: str, option: str, *, as_json: bool, keys: Path | None = None, insecure: bool = False
) -> int:
    """Print the drones that are there.

    Raises:
        LindyError: nobody answers there, or the keys are no good.
    """
    way = door(endpoint, option, WATCHERS, keys, insecure=insecure)
    roster = look(endpoint, None if way is None else way.keys)
    ours = messages_hash(topics.ALL)
    if as_json:
        rows = [as_row(roster.drones[name], ours) for name in roster.names]
        print(json.dumps({"drones": rows, "not_listed": dict(roster.counts)}))
    else:
        print(table(roster, endpoint, ours))
    return 0


def as_row(drone: Drone, ours: str) -> dict[str, Any]:
    """For programs.

    Args:
        ours: hash of the messages of this Lindy.
    """
    identity, status = drone.identity or SideIdentity(), drone.status
    return {
        "name": drone.name,
        "speaks": drone.identity is not None,
        "twice": len(drone.starts) > 1,
        "type": identity.vehicle,
        "version": identity.version,
        "commit": identity.commit,
        "messages": identity.messages,
        "same_messages": identity.messages == ours,
        "mode": None if status is None else status.mode,
        "armed": None if status is None else status.armed,
        "failsafe": None if status is None else status.failsafe,
        "pilot": None if status is None else status.pilot,
        "voltage": None if drone.battery is None else drone.battery.voltage,
        "charge": None if drone.battery is None else _charge(drone.battery),
    }


def table(roster: Roster, endpoint: str, ours: str) -> str:
    """For people, with what was not listed below it."""
    lines = [HEADING, *(_line(roster.drones[name], ours) for name in roster.names)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    rows = [
        "  ".join(word.ljust(width) for word, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    ]
    if not roster.drones:
        rows = [f"no drone can be reached at {endpoint}"]
    return "\n".join([*rows, *roster.remarks])


def _line(drone: Drone, ours: str) -> tuple[str, ...]:
    identity, status = drone.identity, drone.status
    remarks = [TWICE] if len(drone.starts) > 1 else []
    if identity is None:
        remarks.append(SILENT)
    elif identity.messages != ours:
        remarks.append(OTHER_MESSAGES)
    words = (
        drone.name,
        "" if identity is None else identity.vehicle,
        "" if identity is None else identity.version,
        "" if status is None else _mode(status),
        UNKNOWN if drone.battery is None else in_volts(drone.battery),
        "" if status is None else status.pilot or "nobody",
        "; ".join(remarks),
    )
    return tuple(map(clean, words))


def _mode(status: VehicleStatus) -> str:
    """`FAILSAFE pilot lost: stopping, armed`."""
    failsafe = failsafe_words(status)
    words = f"{status.mode}{', armed' if status.armed else ''}"
    return f"{failsafe}: {words}" if failsafe else words


def failsafe_words(status: VehicleStatus) -> str:
    """`FAILSAFE pilot lost`; empty: none acts."""
    return "" if status.failsafe == "none" else f"FAILSAFE {short(f'failsafe:{status.failsafe}')}"


def in_volts(battery: BatterySample) -> str:
    """`16.7 V, 80 %`."""
    charge = _charge(battery)
    return f"{battery.voltage:.1f} V" + ("" if charge is None else f", {100 * charge:.0f} %")


def _charge(battery: BatterySample) -> float | None:
    """[-] What is left; None: the driver does not know how much there was."""
    if not battery.capacity_wh:
        return None
    return min(1.0, max(0.0, 1.0 - battery.used_wh / battery.capacity_wh))
