"""What each added drone costs on two Zenoh routers, and how soon drones are found, and
flown again after a router's restart.

Real drones, grouped, with scripted pilots; synthetic ones where only the network counts.
"""

import os
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from statistics import linear_regression, median
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec

from lindy_research.bench.table import Figure
from messages import topics
from messages.topic import Direction
from messages.vehicle import VehicleStatus
from services.runtime.bus.network import open_network
from services.runtime.bus.spaces import EVERY_SPACE, name_in
from services.runtime.config.errors import LindyError
from tests.support.fleet_network import (
    FlownFleet,
    SyntheticProcess,
    TwoRouters,
    answers,
    begin_pilot,
    start_drones,
    synthetic,
)
from tests.support.patience import until
from tests.support.processes import NOTHING, costs, total
from tests.support.started_dives import HAS_STICKS, PILOT, SETTLE_S, WATCH_S
from tools.fleet.look import look, who_is_there
from tools.recordings.recording import open_recording

SECTION = "fleet"
COUNTS = (1, 2, 4)  # drones that are flown side by side
MANY = 8  # … where there are so many processors
LISTED, LIST_S = 20, 2.0  # drones of a list, and the time for it
LOOKS = 5  # one after the other
RESTART_S = 3.0
AWAY_S = 2.0  # [s] a router is away: long enough that every drone holds by itself
LOADED, SPEED, LOAD_S = 8, 3.0, 6.0  # synthetic drones, times the table's rates, for so long


class SharedRouters(NamedTuple):
    """So many drones, each flown."""

    drones: int
    cores: float  # of all processes, routers included
    routers: float  # of it the two routers
    messages_hz: float  # [1/s] that a topside received of its drone
    bytes_hz: float  # [1/s] of them, without Zenoh's part
    p50_ms: list[float]  # stick to thruster, of each drone
    p99_ms: list[float]


def figures() -> list[Figure]:
    counts = [*COUNTS, *((MANY,) if len(os.sched_getaffinity(0)) >= MANY else ())]
    with TemporaryDirectory(prefix="lindy-bench-") as folder:
        points = [_shared(Path(folder) / str(count), count) for count in counts]
        return [
            *_each_added(points),
            _listed(),
            *_restarted(Path(folder) / "changed"),
            *_per_core(),
        ]


def _shared(folder: Path, count: int) -> SharedRouters:
    folder.mkdir()
    with ExitStack() as exits:
        routers = TwoRouters(exits)
        flown = fly(routers, folder, count, exits)
        time.sleep(SETTLE_S)  # the first seconds after arming are not steady
        pids = {f"{n}/{k}": pid for n, d in enumerate(flown.all) for k, pid in d.pids().items()}
        own = {f"router/{name}": process.pid for name, process in routers.processes.items()}
        found = costs(pids | own, WATCH_S)
        for pilot in flown.pilots:
            pilot.end()
        stick = [drone.report().latency_ms.stick_to_thruster for drone in flown.drones]
    heard = [crossed(folder / f"pilot{number}") for number in range(count)]
    routed = sum((found[name] for name in own if name in found), NOTHING)
    return SharedRouters(
        drones=count,
        cores=total(found).cpu / 100.0,
        routers=routed.cpu / 100.0,
        messages_hz=median(hz for hz, _ in heard),
        bytes_hz=median(size for _, size in heard),
        p50_ms=[each.p50 for each in stick if each.p50 is not None],
        p99_ms=[each.p99 for each in stick if each.p99 is not None],
    )


def fly(routers: TwoRouters, folder: Path, count: int, exits: ExitStack) -> FlownFleet:
    """Drones that are there, each with a pilot who flies."""
    drones = start_drones(routers, folder, count, exits)
    pilots = [
        begin_pilot(routers, folder / f"pilot{number}", name, PILOT, exits)
        for number, name in enumerate(drones)
    ]
    for pilot in pilots:
        pilot.until_said(HAS_STICKS)
    return FlownFleet([*drones.values()], pilots)


def crossed(folder: Path) -> tuple[float, float]:
    """[1/s] Messages, and bytes of them, that came from the drone to this topside."""
    up = {topic.key: topic for topic in topics.ALL if topic.way is Direction.UP}
    first = last = None
    messages = size = 0
    for entry in open_recording(folder):
        if entry.key in up:
            first, last = first or entry.log_ns, entry.log_ns
            messages, size = messages + 1, size + len(msgspec.msgpack.encode(entry.message))
    seconds = ((last or 0) - (first or 0)) / 1e9 or 1.0
    return messages / seconds, size / seconds


def _each_added(points: list[SharedRouters]) -> Iterator[Figure]:
    counts = [float(point.drones) for point in points]
    for name, unit, values in (
        ("processor of all", "cores", [point.cores for point in points]),
        ("processor of both routers", "cores", [point.routers for point in points]),
        ("stick to thruster, worst p99", "ms", [max(point.p99_ms) for point in points]),
        ("stick to thruster, worst p50", "ms", [max(point.p50_ms) for point in points]),
    ):
        slope, start = linear_regression(counts, values)
        measured = ", ".join(f"{n:g}: {v:.3g}" for n, v in zip(counts, values, strict=True))
        yield Figure(
            section=SECTION, name=f"{name}, each added drone", unit=unit, ours=slope,
            note=f"measured {measured}; line {start:.3g} + {slope:.3g} a drone",
        )  # fmt: skip
    for name, values in (
        ("messages up", [p.messages_hz for p in points]),
        ("payload up", [p.bytes_hz / 1e3 for p in points]),
    ):
        unit = "1/s" if name == "messages up" else "kB/s"
        yield Figure(section=SECTION, name=f"{name}, of a drone", unit=unit, ours=median(values))


def _listed() -> Figure:
    """How long it takes somebody who joins to know all drones."""
    took = list[float]()
    with ExitStack() as exits:
        routers = TwoRouters(exits)
        until(lambda: answers(routers.pilots))
        SyntheticProcess("drones", routers.drones, LISTED, exits)
        until(lambda: len(who_is_there(routers.pilots)) == LISTED)
        for _ in range(LOOKS):
            began = time.monotonic()
            roster = look(routers.pilots, longest_s=10.0)
            took.append(time.monotonic() - began)
            missing = LISTED - sum(drone.complete for drone in roster.drones.values())
            if missing:
                raise LindyError(
                    f"{missing} of {LISTED} drones are not known after {took[-1]:.1f} s"
                )
    return Figure(
        section=SECTION, name=f"list of {LISTED} drones complete, worst of {len(took)}", unit="s",
        ours=max(took), baseline_name="goal", baseline=LIST_S, goal=1.0,
        note=f"median {median(took):.2g} s",
    )  # fmt: skip


class Statuses:
    """The newest status of each drone, and when it came."""

    def __init__(self) -> None:
        self.newest: dict[str, tuple[float, VehicleStatus]] = {}
        self._decode = msgspec.msgpack.Decoder(VehicleStatus).decode

    def hear(self, key: str, payload: bytes) -> None:
        self.newest[name_in(key)] = (time.monotonic(), self._decode(payload))

    def flown(self, names: list[str], since_s: float) -> bool:
        """Do the sticks act on all of these, by what they said after this?"""
        said = [self.newest.get(name) for name in names]
        return all(
            each is not None
            and each[0] > since_s
            and each[1].activity == "piloted"
            and each[1].armed
            for each in said
        )


def _restarted(folder: Path) -> Iterator[Figure]:
    folder.mkdir()
    statuses = Statuses()
    with ExitStack() as exits:
        routers = TwoRouters(exits)
        names = list(start_drones(routers, folder, 2, exits))
        network = exits.enter_context(open_network(routers.pilots, 5.0))
        network.hear(
            f"{EVERY_SPACE}/{topics.STATUS.key}", lambda each: statuses.hear(each.key, each.payload)
        )
        first = begin_pilot(routers, folder / "first", names[0], PILOT, exits)
        until(lambda: statuses.flown(names[:1], 0.0))
        second = begin_pilot(routers, folder / "second", names[1], PILOT, exits)
        until(lambda: statuses.flown(names, time.monotonic() - 1.0))
        routers.kill()
        time.sleep(AWAY_S)
        began = time.monotonic()
        routers.start_again()
        until(lambda: statuses.flown(names, began))
        yield Figure(
            section=SECTION, name="router's restart, to all drones flown again", unit="s",
            ours=time.monotonic() - began, baseline_name="goal", baseline=RESTART_S, goal=1.0,
            note=f"{len(names)} drones; it was away for {AWAY_S:g} s; with the start of the router",
        )  # fmt: skip
        second.end()
        first.end()


def _per_core() -> Iterator[Figure]:
    """How many messages a core routes, where only routers work for them."""
    with ExitStack() as exits:
        routers = TwoRouters(exits)
        until(lambda: answers(routers.pilots))
        with synthetic(routers, LOADED, SPEED) as (drones, pilots):
            time.sleep(SETTLE_S)
            cost = routers.costs(LOAD_S)
            up, down = pilots.end(), drones.end()
    hz = sum(each["heard_steady"] / (each["seconds"] - 1.0) for each in (up, down))
    cores = cost.cpu / 100.0
    yield Figure(
        section=SECTION, name="messages through two routers, of a core", unit="1/s",
        ours=hz / cores,
        note=f"{hz:.0f} messages a second of {LOADED} synthetic drones and pilots at {SPEED:g} "
        f"times their rates, {cores:.2f} cores of both routers, p99 {up['p99_ms']:.1f} ms",
    )  # fmt: skip
