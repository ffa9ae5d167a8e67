"""All drones that are there, as `lindy fleet` shows them: from the roster, what came when, and who
has gone. Pure."""

from collections.abc import Iterator
from math import degrees
from typing import NamedTuple

from msgspec import UNSET, UnsetType

from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.runtime.bus.spaces import here_of, name_in
from tools.fleet.drones import OTHER_MESSAGES, SILENT, TWICE, failsafe_words, in_volts
from tools.fleet.hearing import Hearing
from tools.fleet.roster import MOST, Drone, Roster

SECOND: Ns = 1_000_000_000
OLD_NS = 2 * SECOND  # a status comes five times a second
BATTERY_OLD_NS = 5 * SECOND  # a battery comes once a second
TOGETHER_NS = 2 * SECOND  # whoever goes so shortly before the router is missed went with it
GONE_NS = 600 * SECOND  # how long a drone that has gone stays on the screen


class FleetRow(NamedTuple):
    """One drone."""

    name: str
    mode: str  # empty: not known
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
        self._batteries: dict[
            str, Ns
        ] = {}  # when each was heard; before it was: when its drone was
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
        return FleetRow(
            name=drone.name,
            mode="" if status is None else status.mode,
            armed=status is not None and status.armed,
            depth_m=None if status is None else _known(status.depth),
            heading_deg=None if status is None else _compass(status.heading),
            battery=_battery(drone, battery_age),
            age_s=None if age is None else max(0.0, age / 1e9),
            loss=None if hearing is None else hearing.loss(now),
            pilot="" if status is None else status.pilot,
            alarms=tuple(self._alarms(drone, age, battery_age)),
            failsafe=_failsafe(status),
            speaks=drone.speaks,
            gone=False,
        )

    def _alarms(self, drone: Drone, age: Ns | None, battery_age: Ns) -> Iterator[str]:
        if silent := age is not None and age > OLD_NS:
            yield f"not heard for {_seconds(age or 0)}"
        if len(drone.starts) > 1:
            yield TWICE
        status, identity = drone.status, drone.identity
        if status is not None and (failsafe := failsafe_words(status)):
            yield f"{failsafe}, {status.reaction}" if status.reaction else failsafe
        if battery_age > BATTERY_OLD_NS and not silent:
            yield f"battery silent for {_seconds(battery_age)}"
        if status is not None and status.note:
            yield status.note
        if not drone.speaks:
            yield SILENT
        if identity is not None and identity.messages != self._ours:
            yield OTHER_MESSAGES


def _battery(drone: Drone, age: Ns) -> str:
    return "" if drone.battery is None or age > BATTERY_OLD_NS else in_volts(drone.battery)


def _failsafe(status: VehicleStatus | None) -> str:
    return "" if status is None or status.failsafe == "none" else status.failsafe


def _known(value: float | UnsetType) -> float | None:
    return None if value is UNSET else value


def _compass(heading: float | UnsetType) -> float | None:
    """[°] As it is shown: 0 … 359.9."""
    return None if heading is UNSET else round(degrees(heading), 1) % 360.0


def _seconds(span: Ns) -> str:
    return f"{max(0, span) / 1e9:.0f} s"
