"""Several drones whose pilots change, on two routers that fail, for long: does anything grow,
act late, or reach the wrong drone? `python -m tests.long.fleet_soak [MINUTES] [SEED] [DRONES]`.

Real processes in real time. Two desks fly, each a drone after the other; meanwhile routers are
killed or stopped, and the hubs of drones stopped, at seeded random. Afterwards every recording is
read. A command that reached another drone than its pilot's has the wrong name in it: each flight
has a script of its own, whose name says of which drone it is.
"""

import random
import signal
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from os import kill
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from messages import topics
from messages.pilot import PilotCommand
from messages.reference import Reference
from messages.topic import Direction
from messages.vehicle import VehicleStatus
from tests.long.soak import EVERY_S, Life, Sample, growths, sample, show
from tests.support.fleet_network import TwoRouters, begin_pilot, start_drones
from tests.support.started_dives import StartedDive
from tools.log.check import accounts
from tools.recordings.recording import open_recording

MINUTES, SEED, DRONES = 30.0, 1, 4
DESKS = 2
PAUSE_S = 20.0  # [s] between two faults, on average
FLIGHT_S = (15.0, 45.0)  # [s] shortest and longest flight of one pilot with one drone
OUTAGE_S = (0.2, 5.0)  # [s] a router is away; one that is back sooner is not found by everybody
STOP_S = (0.2, 3.0)  # [s] a process is stopped
STALE_NS = 300_000_000 + 250_000_000  # [ns] a command's time to live, and a busy computer's delay
HUB = "hub_drone"
SCRIPT = "script "  # what the name of a pilot that is a script begins with


class Desk:
    """A pilot's desk: a topside for one drone, then one for another."""

    def __init__(self, number: int) -> None:
        self.number, self.drone, self.until_s = number, "", 0.0
        self.topside: StartedDive | None = None
        self.flights = 0


class FleetSoak:
    """Drones, desks and routers that are running."""

    def __init__(
        self, folder: Path, minutes: float, seed: int, drones: int, exits: ExitStack
    ) -> None:
        self.lives: defaultdict[Life, list[Sample]] = defaultdict(list)
        self.faults, self.flights = Counter[str](), Counter[str]()
        self.hubs_stopped = Counter[str]()  # by drone
        self._random, self._minutes, self._folder = random.Random(seed), minutes, folder
        self._exits = exits
        self._routers = TwoRouters(exits)
        self._drones = start_drones(self._routers, folder, drones, exits)
        self._desks = [Desk(number) for number in range(min(DESKS, drones))]

    @property
    def names(self) -> list[str]:
        return list(self._drones)

    def run(self) -> None:
        began = time.monotonic()
        next_fault = began + self._random.expovariate(1.0 / PAUSE_S)
        while (now := time.monotonic()) - began < 60.0 * self._minutes:
            for desk in self._desks:
                self._attend(desk, now)
            self._look(now - began)
            if now >= next_fault:
                self._fault()
                next_fault = time.monotonic() + self._random.expovariate(1.0 / PAUSE_S)
            time.sleep(EVERY_S)
        for desk in self._desks:
            if desk.topside is not None:
                desk.topside.end()
        for drone in self._drones.values():
            drone.end()

    def _attend(self, desk: Desk, now: float) -> None:
        """End a flight whose time is over, and begin the next one."""
        if now < desk.until_s:
            return
        if desk.topside is not None:
            desk.topside.end()
        taken = {other.drone for other in self._desks if other is not desk}
        desk.drone = self._random.choice([n for n in self._drones if n not in taken])
        name = f"desk{desk.number}-{desk.drone}-{desk.flights}"
        script = self._folder / f"{name}.csv"
        script.write_text("\n".join(self._sticks()) + "\n")
        pilot = ("--pilot", f"script:{script}")
        # Each is to be ended at the end, whatever happens.
        desk.topside = begin_pilot(
            self._routers, self._folder / name, desk.drone, pilot, self._exits
        )
        desk.flights += 1
        desk.until_s = time.monotonic() + 10.0 + self._random.uniform(*FLIGHT_S)
        self.flights[desk.drone] += 1

    def _sticks(self) -> Iterator[str]:
        yield "t,surge,sway,heave,yaw"
        yield "0,0,0,0,0"
        for second in range(1, 300, 3):
            sticks = (self._random.choice([0.0, self._random.uniform(-1, 1)]) for _ in range(4))
            yield ",".join([str(second), *(f"{stick:.2f}" for stick in sticks)])

    def _look(self, at_s: float) -> None:
        pids = {f"router_{name}": each.pid for name, each in self._routers.processes.items()}
        for name, drone in self._drones.items():
            pids |= {f"{name}/{part}": pid for part, pid in drone.pids().items()}
        for name, pid in pids.items():
            if (one := sample(pid, at_s)) is not None:
                self.lives[Life(name, pid)].append(one)

    def _fault(self) -> None:
        kind = self._random.choice(["router killed", "router stopped", "hub stopped"])
        self.faults[kind] += 1
        if kind == "router killed":
            self._routers.kill()
            time.sleep(self._random.uniform(*OUTAGE_S))
            self._routers.start_again()
            return
        if kind == "router stopped":
            pid = self._routers.processes[self._random.choice(["drones", "pilots"])].pid
        else:
            name = self._random.choice(self.names)
            self.hubs_stopped[name] += 1
            pid = self._drones[name].pids()[HUB]
        with suppress(ProcessLookupError):
            kill(pid, signal.SIGSTOP)
            time.sleep(self._random.uniform(*STOP_S))
            kill(pid, signal.SIGCONT)


class DroneRead(NamedTuple):
    """What a drone's recording says."""

    commands: int
    mixed_up: int  # commands and pilots of another drone
    stale: int  # references that an old command made
    flown: int  # references that a command made
    pilots: int  # that had control, one after the other


def read(folder: Path, name: str) -> DroneRead:
    """Of the drone of this name."""
    own, found, pilots = f"-{name}-", Counter[str](), set[str]()
    for entry in open_recording(folder):
        match entry.message:
            case PilotCommand(source=source):
                found["commands"] += 1
                found["mixed_up"] += own not in source
            case VehicleStatus(pilot=pilot) if pilot:
                pilots.add(pilot)
                found["mixed_up"] += own not in pilot
            case Reference(pilot_ns=int(pilot_ns), stamp_ns=stamp_ns):
                found["flown"] += 1
                found["stale"] += stamp_ns - pilot_ns > STALE_NS
            case _:
                pass
    return DroneRead(
        found["commands"], found["mixed_up"], found["stale"], found["flown"], len(pilots)
    )


def own_missing(folder: Path) -> int:
    """Messages that were said on board, are not in the recording made there, and of which nobody
    knows where they are. What a pilot said may be lost with a router, which counts nothing."""
    return sum(
        account.missing
        for key, account in accounts(open_recording(folder)).topics.items()
        if (topic := topics.find(key)) is not None and topic.way in (Direction.UP, Direction.STAY)
    )


def judged(folder: Path, soak: FleetSoak) -> bool:
    """Read every recording, and print what is in it. Returns whether all is well."""
    well = True
    for name in soak.names:
        found, missing = read(folder / name, name), own_missing(folder / name)
        damage = open_recording(folder / name).damage
        stopped = soak.hubs_stopped[name]
        print(
            f"{name}: {found} in {soak.flights[name]} flights; {missing} of its own messages "
            f"missing, its hub was stopped {stopped} times; {'; '.join(damage) or 'whole'}"
        )
        # A hub that is stopped for longer than its queues last loses what is said meanwhile.
        lost = missing > 0 and not stopped
        well = well and not (lost or damage or found.mixed_up or found.stale)
    for topside in sorted(folder.glob("desk*-*/")):
        if not any(topside.rglob("*.mcap")):
            print(f"{topside.name}: nothing recorded: its drone was not reached in its time")
            continue
        recording = open_recording(topside)
        messages = sum(1 for _ in recording)
        damage = "; ".join(recording.damage) or "whole"
        print(f"{topside.name}: {messages} messages, {damage}")
        well = well and not recording.damage
    return well


def main(minutes: float, seed: int, drones: int) -> int:
    with TemporaryDirectory(prefix="lindy-soak-") as place:
        folder = Path(place)
        with ExitStack() as exits:
            soak = FleetSoak(folder, minutes, seed, drones, exits)
            soak.run()
        print(f"{minutes:g} minutes, seed {seed}, {drones} drones; faults: {dict(soak.faults)}")
        grown = show(growths(soak.lives))
        well = judged(folder, soak)
    return int(grown or not well)


if __name__ == "__main__":
    given = [float(word) for word in sys.argv[1:]]
    minutes, seed, drones = (*given, *(MINUTES, SEED, DRONES)[len(given) :])
    sys.exit(main(minutes, int(seed), int(drones)))
