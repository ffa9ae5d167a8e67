"""The drones that a pilot may take instead of the one he flies, as his cockpit lists them. Pure."""

from collections.abc import Collection, Iterable

from messages.fly import MOST_DRONES, DroneList, ReachableDrone
from messages.identity import SideIdentity, difference
from messages.units import Ns
from services.runtime.bus.spaces import LONGEST
from tools.fleet.names import clean
from tools.fleet.roster import BEYOND
from tools.fleet.watching import FleetRow, FleetWatch

SHOWN = 24  # [characters] of a vehicle's or a pilot's name
LONGEST_WORDS = 200  # [characters] of a sentence


def drone_list(watch: FleetWatch, ours: SideIdentity, flown: str, left: str, now: Ns) -> DroneList:
    """Of more than `MOST_DRONES`, those that speak are listed first; the rest is counted.

    Args:
        ours: of the topside that flies.
        flown: the drone that is flown now.
        left: what has become of the one that was left last.
    """
    there = [row for row in watch.rows(now) if not row.gone]
    first = sorted(there, key=lambda row: (row.name != flown, not row.speaks))  # else by name
    listed = sorted(first[:MOST_DRONES], key=lambda row: (not row.speaks, row.name))
    return DroneList(
        stamp_ns=now,
        flown=flown,
        drones=tuple(_reachable(row, watch, ours) for row in listed),
        more=len(there) - len(listed) + watch.roster.counts[BEYOND],
        left=left[:1000],
    )


def misfit(drone: str, ours: SideIdentity, theirs: SideIdentity) -> str:
    """Why a drone cannot be flown by this topside; empty: it can.

    Args:
        theirs: what the drone says of itself.
    """
    why = difference(ours, theirs)
    return f"{drone} cannot be flown from here: {clean(why, LONGEST_WORDS)}" if why else ""


def still_armed(left: Collection[str], rows: Iterable[FleetRow]) -> list[str]:
    """What a pilot who goes is to be told of drones that he has left on the way: of each that is
    armed and that nobody flies, or that is not heard.

    Args:
        rows: of the drones that were heard.
    """
    known = {row.name: row for row in rows if not row.gone}
    said = list[str]()
    for name in sorted(left):
        row = known.get(name)
        if row is None:
            said.append(f"{name} is not heard now: if it is armed, it holds, and rises later")
        elif row.armed and not row.pilot:
            said.append(f"{name} is still armed, and nobody flies it: `lindy fly {name}` takes it")
    return said


def _reachable(row: FleetRow, watch: FleetWatch, ours: SideIdentity) -> ReachableDrone:
    identity = watch.identity(row.name)
    return ReachableDrone(
        name=clean(row.name, LONGEST),
        vehicle="" if identity is None else clean(identity.vehicle, SHOWN),
        activity=row.activity,
        armed=row.armed,
        pilot=clean(row.pilot, SHOWN),
        failsafe=bool(row.failsafe),
        alarms=clean("; ".join(row.alarms), LONGEST_WORDS),
        misfit="" if identity is None else clean(difference(ours, identity), LONGEST_WORDS),
    )
