"""All drones that are there, as `lindy fleet` shows them: from the roster, what came when, and who
has gone. Pure."""

from collections.abc import Iterator
from typing import NamedTuple

from messages.identity import SideIdentity
from messages.units import Ns
from services.runtime.bus.spaces import here_of, name_in
from services.vehicle_view import ages, words
from services.vehicle_view.view import VehicleView
from tools.fleet.drones import OTHER_MESSAGES, SILENT, TWICE, seen
from tools.fleet.hearing import Hearing
from tools.fleet.roster import MOST, Drone, Roster

SECOND: Ns = 1_000_000_000
TOGETHER_NS = 2 * SECOND  # whoever goes so shortly before the router is missed went with it
GONE_NS = 600 * SECOND  # how long a drone that has gone stays on the screen


class FleetRow(NamedTuple):
    """One drone."""

    name: str
    activity: str  # empty: not known
    armed: bool
    depth_m: float | None
    heading_deg: float | None  # 0 … 360
    battery: str  # in words; empty: not known, or too old to be believed
    age_s: float | None  # since it was last heard
    loss: float | None  # [-] of its words that did not come here
    pilot: str  # who flies; empty: nobody
    alarms: tuple[str, ...]  # the gravest first
    failsafe: str  # the condition that acts; empty: none
    speaks: bool  # else its name was announced, and nothing more
    gone: bool


class FleetWatch:
    """Tokens and rows of all drones, in any order."""

    def __init__(self, ours: str) -> None:
        """
        Args:
            ours: hash of the messages of this Lindy.
        """
        self.roster = Roster()
        self._ours = ours
        self._hearings: dict[str, Hearing] = {}
        # When each was heard; before it was: when its drone was.
        self._batteries: dict[str, Ns] = {}
        self._gone: dict[str, tuple[Drone, Ns]] = {}
        self._away_ns: Ns | None = None  # since when the router does not answer

    @property
    def router_answers(self) -> bool:
        return self._away_ns is None

    def router(self, answers: bool, now: Ns) -> None:
        """Does it answer? Without it nothing is known of the drones, also not that they went."""
        if answers:
            self._away_ns = None
        elif self._away_ns is None:
            self._away_ns = now

    def token(self, key: str, there: bool, now: Ns) -> None:
        """A drone's hub came, or went."""
        here = here_of(key)
        before = None if here is None else self.roster.drones.get(here.name)
        self.roster.token(key, there)
        if here is None:
            return
        if here.name in self.roster.drones:
            if self._gone.pop(here.name, None) is not None:  # nothing of before is believed
                self._batteries.pop(here.name, None)
        elif before is not None and before.speaks:
            self._gone[here.name] = (before, now)
            if len(self._gone) > MOST:
                del self._gone[next(iter(self._gone))]

    def row(self, key: str, payload: bytes, now: Ns) -> None:
        """One of the roster's rows of a drone."""
        drone = self.roster.drones.get(name := name_in(key))
        before = (None, None) if drone is None else (drone.status, drone.battery)
        self.roster.row(key, payload)
        drone = self.roster.drones.get(name)
        if drone is None:
            return
        if name not in self._batteries:
            self._forget()
        if drone.status is not None and drone.status is not before[0]:
            self._hearings.setdefault(name, Hearing()).hear(drone.status.seq, now)
            self._batteries.setdefault(name, now)
        if drone.battery is not None and drone.battery is not before[1]:
            self._batteries[name] = now

    def _forget(self) -> None:
        """Of those who are not shown any more."""
        for times in (self._hearings, self._batteries):
            for name in times.keys() - self.roster.drones.keys() - self._gone.keys():
                del times[name]

    def identity(self, name: str) -> SideIdentity | None:
        """What a drone that is shown said of itself; also one that has just gone."""
        drone = self.roster.drones.get(name) or self._gone.get(name, (None,))[0]
        return None if drone is None else drone.identity

    def rows(self, now: Ns) -> list[FleetRow]:
        """By name, those that have gone among them."""
        for name, (_, since) in list(self._gone.items()):
            if now - since > GONE_NS:
                del self._gone[name]
        there = [self._row(drone, now) for drone in self.roster.drones.values()]
        gone = [self._gone_row(drone, since, now) for drone, since in self._gone.values()]
        return sorted([*there, *gone], key=lambda row: row.name)

    def _gone_row(self, drone: Drone, since: Ns, now: Ns) -> FleetRow:
        row = self._row(drone, now)
        if self._away_ns is not None and since >= self._away_ns - TOGETHER_NS:
            return row
        return row._replace(alarms=(f"gone for {_seconds(now - since)}",), gone=True)

    def _row(self, drone: Drone, now: Ns) -> FleetRow:
        status, hearing = drone.status, self._hearings.get(drone.name)
        age = None if hearing is None or status is None else now - hearing.heard_ns
        battery_age = now - self._batteries.get(drone.name, now)
        view = seen(drone, age or 0, battery_age)
        return FleetRow(
            name=drone.name,
            activity=view.activity,
            armed=view.armed,
            depth_m=view.depth_m,
            heading_deg=view.heading_deg,
            battery="" if view.battery_v is None else words.battery(view),
            age_s=None if age is None else max(0.0, age / 1e9),
            loss=None if hearing is None else hearing.loss(now),
            pilot=view.pilot,
            alarms=tuple(self._alarms(drone, view, age, battery_age)),
            failsafe=view.failsafe if view.acts else "",
            speaks=drone.speaks,
            gone=False,
        )

    def _alarms(
        self, drone: Drone, view: VehicleView, age: Ns | None, battery_age: Ns
    ) -> Iterator[str]:
        if view.last_known:
            yield f"not heard for {_seconds(age or 0)}"
        if len(drone.starts) > 1:
            yield TWICE
        if view.acts:
            yield f"{words.failsafe(view)}: {words.doing(view)}"
        if battery_age > ages.BATTERY.grey_ns and not view.last_known:
            yield f"battery silent for {_seconds(battery_age)}"
        if view.note:
            yield view.note
        if not drone.speaks:
            yield SILENT
        if drone.identity is not None and drone.identity.messages != self._ours:
            yield OTHER_MESSAGES


def _seconds(span: Ns) -> str:
    return f"{max(0, span) / 1e9:.0f} s"
