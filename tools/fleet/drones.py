"""`lindy drones`: who is there, at a drone's own endpoint or on a whole network."""

import json
import sys
import time
from typing import Annotated, Any

import msgspec
from cyclopts import Parameter

from messages import topics
from messages.identity import SideIdentity
from messages.text import harmless
from services.runtime.bus.zenoh_bus import NobodyThereError
from services.runtime.config.errors import LindyError
from services.runtime.config.identity import messages_hash
from services.vehicle_view import words
from services.vehicle_view.view import Newest, VehicleView, vehicle_view
from tools.ask import dives_here
from tools.choices import HERE, Insecure, Json, KeysFolder, Router
from tools.fleet.network import Drone, Roster, look
from tools.keys.credentials import Role, credentials
from tools.live.stop_signals import StopSignals
from tools.text_table import aligned

WATCHERS: tuple[Role, ...] = ("observer", "pilot")
HEADING = ("name", "type", "Lindy", "activity", "battery", "who flies", "")
UNKNOWN = "–"
SILENT = "is announced, but says nothing"
OTHER_MESSAGES = "other messages than here: cannot be flown from here"
TWICE = "two drones of this name"
WATCH_S = 1.0  # [s] between two lists
LONGEST_CELL = 120  # [letters] of a text from a network


def drones(
    *,
    router: Router = HERE,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    watch: Annotated[
        bool, Parameter(negative=(), help="list them again and again, until Ctrl-C")
    ] = False,
    as_json: Json = False,
) -> int:
    """List the drones that can be reached.

    Name, type, version, mode, battery, and who flies.

    Example: lindy drones --router tls/192.168.2.1:7447
    """
    way = credentials(router, "--router", WATCHERS, keys, insecure=insecure)
    ours, said = messages_hash(topics.ALL), ""
    with StopSignals() as stop:
        while True:
            try:
                roster = look(router, None if way is None else way.keys)
            except NobodyThereError as error:
                if not watch:
                    raise LindyError(f"{error}{_alone()}") from None
                if str(error) != said:
                    said = str(error)
                    print(f"lindy: {said}; waits for it", file=sys.stderr, flush=True)
            else:
                said = ""
                rows = {"drones": [as_row(roster.drones[name], ours) for name in roster.names]}
                print(json.dumps(rows) if as_json else table(roster, router, ours), flush=True)
            if not watch or stop.asked:
                return 0
            time.sleep(WATCH_S)


def _alone() -> str:
    """What to do about a dive of this machine that nobody can reach, as the end of a sentence."""
    try:
        names = ", ".join(sorted(running.vehicle for running in dives_here()))
    except LindyError:
        return ""
    return (
        f"; the dive of {names} that is going on here is reached with `lindy dive --listen {HERE}` "
        f"only; `lindy top` and `lindy topic` look into it"
    )


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
        "activity": None if status is None else status.activity,
        "armed": None if status is None else status.armed,
        "failsafe": None if status is None else status.failsafe,
        "pilot": None if status is None else status.pilot,
        "voltage": None if drone.battery is None else drone.battery.voltage,
        "charge": seen(drone).charge,
    }


def table(roster: Roster, endpoint: str, ours: str) -> str:
    """For people."""
    if not roster.drones:
        return f"no drone can be reached at {endpoint}"
    lines = [HEADING, *(_line(roster.drones[name], ours) for name in roster.names)]
    return "\n".join(aligned(lines, left=len(HEADING)))


def _line(drone: Drone, ours: str) -> tuple[str, ...]:
    identity, view = drone.identity, seen(drone)
    remarks = [TWICE] if len(drone.starts) > 1 else []
    if identity is None:
        remarks.append(SILENT)
    elif identity.messages != ours:
        remarks.append(OTHER_MESSAGES)
    cells = (
        drone.name,
        "" if identity is None else identity.vehicle,
        "" if identity is None else identity.version,
        _activity(view),
        UNKNOWN if view.battery_v is None else words.battery(view),
        "" if drone.status is None else view.pilot or "nobody",
        "; ".join(remarks),
    )
    return tuple(harmless(cell.replace("\n", " "))[:LONGEST_CELL] for cell in cells)


def _activity(view: VehicleView) -> str:
    """`FAILSAFE pilot lost: stopping, armed`."""
    known = f"{view.activity}{', armed' if view.armed else ''}"
    return f"{words.failsafe(view)}: {known}" if view.acts else known


def seen(drone: Drone) -> VehicleView:
    """What is shown of a drone, by the drone's own clock, which may differ from the one here."""
    now = 0 if drone.status is None else drone.status.stamp_ns
    battery = drone.battery
    if battery is not None:
        battery = msgspec.structs.replace(battery, stamp_ns=now)
    return vehicle_view(Newest(status=drone.status, battery=battery), now)
