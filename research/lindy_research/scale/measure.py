"""Synthetic drones and pilots on two routers of this machine, and what these need for them."""

import re
import shutil
import subprocess
import time
from contextlib import ExitStack

from lindy_research.scale.model import JOIN_S, FleetJoin, ScalePoint
from tests.support.fleet_network import (
    SyntheticProcess,
    TwoRouters,
    answers,
)
from tests.support.patience import until
from tests.support.processes import spent_s
from tools.fleet.look import who_is_there

FLEETS = ((1, 1.0), (2, 1.0), (4, 1.0), (8, 1.0), (12, 1.0), (4, 4.0), (8, 3.0), (12, 3.0))
JOINING = (*((n, False) for n in (10, 20, 40, 60, 80, 120)), (120, True), (240, True))
SETTLE_S, WINDOW_S, REST_S = 2.0, 6.0, 3.0
LOOK_S = 0.02  # [s] between two looks at who is there
PROCESSES = 4  # that the drones share which join
SLOW = 0.01  # times the table's rates: drones that only are there


def measured_point(drones: int, speed: float) -> ScalePoint:
    """Drones and pilots that speak, for some seconds."""
    with ExitStack() as exits:
        routers = _routers(exits)
        flown = SyntheticProcess("drones", routers.drones, drones, exits, speed)
        pilots = SyntheticProcess("pilots", routers.pilots, drones, exits, speed)
        flown.until_ready()
        pilots.until_ready()
        time.sleep(SETTLE_S)
        before, began = wire_bytes(routers.drones), time.monotonic()
        cost = routers.costs(WINDOW_S)
        after, seconds = wire_bytes(routers.drones), time.monotonic() - began
        up, down = pilots.end(), flown.end()
    both = (up, down)
    return ScalePoint(
        drones=drones,
        speed=speed,
        messages_hz=sum(each["heard_steady"] / (each["seconds"] - 1.0) for each in both),
        payload_hz=sum(each["payload_steady"] / (each["seconds"] - 1.0) for each in both),
        wire_hz=None if before is None or after is None else (after - before) / seconds,
        cores=cost.cpu / 100.0 / 2.0,
        p50_ms=up["p50_ms"],
        p99_ms=up["p99_ms"],
    )


def measured_join(drones: int, clients: bool) -> FleetJoin:
    """Drones that join at once, and say next to nothing."""
    each = drones // PROCESSES
    with ExitStack() as exits:
        routers = _routers(exits)
        pids = {name: process.pid for name, process in routers.processes.items()}
        before, began = _spent_s(pids), time.monotonic()
        for first in range(0, drones, each):
            more = ["--first", str(first), *(["--clients"] if clients else [])]
            SyntheticProcess(
                "drones", routers.drones, min(each, drones - first), exits, SLOW, *more
            )
        while (joined := len(who_is_there(routers.pilots))) < drones:
            if time.monotonic() - began > JOIN_S:
                break
            time.sleep(LOOK_S)  # other processes do it, and nothing announces it
        seconds = time.monotonic() - began if joined == drones else None
        spent = _spent_s(pids) - before
        time.sleep(SETTLE_S)
        return FleetJoin(drones, clients, seconds, spent, routers.costs(REST_S).cpu / 100.0)


def wire_bytes(endpoint: str) -> int | None:
    """Bytes that the link between both routers has carried in both directions, as the operating
    system counts them for TCP; None: it does not say so here.

    Args:
        endpoint: of the router of the drones, which the other one calls.
    """
    if shutil.which("ss") is None:
        return None
    port = endpoint.rpartition(":")[2]
    words = ["ss", "-tinHO", "state", "established", "dport", "=", f":{port}"]
    lines = subprocess.run(words, check=True, capture_output=True, text=True).stdout.splitlines()
    counts = [
        sum(int(found) for found in re.findall(r"bytes_(?:sent|received):(\d+)", line))
        for line in lines
    ]
    return max(counts, default=None)  # all others are of one drone each


def _spent_s(pids: dict[str, int]) -> float:
    """[s] Processor time that these processes have spent in their life."""
    return sum(spent_s(pid) for pid in pids.values())


def _routers(exits: ExitStack) -> TwoRouters:
    routers = TwoRouters(exits)
    until(lambda: answers(routers.pilots) and answers(routers.drones))
    return routers
