"""A place held with a DVL against a current: Lindy, and ArduSub's POSHOLD with the same reports."""

import socket
import time
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lindy_research.ardusub_comparison.firmware import TruthObserver, firmware, free_port
from lindy_research.ardusub_comparison.flights import LINDY, commanded, dive, vehicle_file
from lindy_research.ardusub_comparison.plain_station import PlainStation
from lindy_research.ardusub_comparison.releases import (
    JudgedRelease,
    TrueMotion,
    integral,
    judge_way,
)
from lindy_research.ardusub_comparison.sea import CurrentChange, Sea
from lindy_research.ardusub_comparison.sticks import StickMove, sticks_at
from services.mavlink_io.packet import MavCommand, MavlinkPacket, command

POSHOLD = 16
HOLD_S, PLAN_S = 16.0, 22.0  # [s] of the sticks: the place is held from then on, the plan begins
STAGE_S, SETTLES_S = 25.0, 12.0  # [s] of each current, and of it not counted as settled
# The drone's bow is to the east: from the port bow, harder, and then from astern.
PLAN = (
    CurrentChange(0.0, 0.0, 0.0),
    CurrentChange(STAGE_S, 0.2, 180.0),
    CurrentChange(2 * STAGE_S, 0.4, 180.0),
    CurrentChange(3 * STAGE_S, 0.4, 90.0),
)
STAGES = ("still water", "0.2 m/s to starboard", "0.4 m/s to starboard", "0.4 m/s ahead")
PUSH_S, AFTER_S = 4.0, 10.0  # [s] of surge, and of rest after it
WAIT_S = PLAN_S - 6.0  # [s] from a depth of 2 m, and so before surge is pushed
SURGE_AT = PLAN_S + 4 * STAGE_S
MOVES = (
    StickMove(0.0),
    StickMove(1.0, heave=1.0),
    StickMove(4.5),
    StickMove(SURGE_AT, surge=1.0),
    StickMove(SURGE_AT + PUSH_S),
    StickMove(SURGE_AT + PUSH_S + AFTER_S),
)
WATER = "SIM_WIND_T 1\nSIM_WIND_TC 1\nSIM_WIND_SPD 0\nSIM_GPS1_ENABLE 0\nGPS1_TYPE 0\n"
# As BlueOS's extension for the DVL sets them.
EXTENSION = """AHRS_EKF_TYPE 3
EK3_ENABLE 1
VISO_TYPE 1
EK3_SRC1_POSXY 6
EK3_SRC1_VELXY 6
EK3_SRC1_POSZ 1
"""
POSHOLD_SURGE = 0.28  # [-] of its full stick, for about 0.3 m/s
# Gains by the rule of bluerov2_heavy for this simulator's 10.5 kg, ω = 2 rad/s.
PLACE = (
    "control.surge.kp=42.0",
    "control.surge.kd=40.0",
    "control.surge.ki=8.4",
    "control.sway.kp=42.0",
    "control.sway.kd=40.0",
    "control.sway.ki=8.4",
)


class HeldStage(NamedTuple):
    what: str
    most: float  # [m] farthest from the place, over the whole stage
    settled: float  # [m] 95 % of the time within, once it has settled


class StationFlight(NamedTuple):
    name: str
    stages: list[HeldStage]
    stop: JudgedRelease  # surge let go, over the ground


def keep_with_lindy(path: str, folder: Path) -> StationFlight:
    """
    Raises:
        RuntimeError: the dive does not end in order.
    """
    folder.mkdir(parents=True)
    sea, truth_port = Sea(PLAN, WAIT_S), free_port()
    observer = TruthObserver(truth_port, sea.see)
    rows = [f"{m.at:g},{m.surge:g},0,{m.heave:g},0," for m in MOVES]
    rows.insert(3, f"{HOLD_S:g},0,0,0,0,mode station_keeping")
    script = "\n".join(["t,surge,sway,heave,yaw,event", *rows]) + "\n"
    overrides = (*LINDY, *PLACE, f"waterlinked.url=tcp:127.0.0.1:{sea.dvl.port}")
    vehicle = str(vehicle_file(folder))
    try:
        dive(
            path, vehicle, overrides, script, folder, truth_port,
            stack="ardusub_instruments", parameters=WATER,
        )  # fmt: skip
    finally:
        truth = observer.close()
        sea.dvl.power_off()
    sticks = commanded(folder / "dive")
    assert sea.began is not None
    return judged_station("Lindy", truth, sea.began, _let_go(sticks))


def keep_with_poshold(path: str, folder: Path) -> StationFlight:
    """
    Raises:
        RuntimeError: the board does not arm, or refuses POSHOLD.
    """
    port, truth_port = free_port(), free_port()
    sea, sent = Sea(PLAN, WAIT_S), list[StickMove]()
    observer = TruthObserver(truth_port, sea.see)
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
        firmware(path, port, truth_port, folder / "board", WATER + EXTENSION),
    ):
        link.bind(("127.0.0.1", port))
        station = PlainStation(link, POSHOLD_SURGE)
        station.wait_until_armed()
        began, asked = time.monotonic(), 0.0
        while (t := time.monotonic() - began) < MOVES[-1].at:
            if t > HOLD_S and station.mode != POSHOLD and t > asked + 1.0:
                asked = t
                station.send(ORIGIN)  # without which its estimator has no place to hold
                station.send(command(1, MavCommand.DO_SET_MODE, 1, POSHOLD))
            if t > PLAN_S and station.mode != POSHOLD:
                raise RuntimeError(f"no POSHOLD: {station.texts[-8:]}")
            sticks = sticks_at(list(MOVES), t)
            sent.append(sticks._replace(at=time.time()))
            station.steer(sticks)
    truth = observer.close()
    sea.dvl.power_off()
    assert sea.began is not None
    return judged_station("POSHOLD", truth, sea.began, _let_go(sent))


ORIGIN = MavlinkPacket(
    "SET_GPS_GLOBAL_ORIGIN",
    {"target_system": 1, "latitude": 634000000, "longitude": 104000000, "altitude": 0},
)


def _let_go(sticks: list[StickMove]) -> float:
    """[s] UTC, when surge was."""
    return next(b.at for a, b in pairwise(sticks) if a.surge and not b.surge)


def judged_station(name: str, truth: TrueMotion, began: float, let_go: float) -> StationFlight:
    """
    Args:
        began: [s] UTC, of the plan.
        let_go: [s] UTC, when surge was.
    """
    north, east = (integral(truth.t, speed) for speed in (truth.north, truth.east))
    place = (truth.t > began + SETTLES_S) & (truth.t < began + STAGE_S)
    off = np.hypot(north - north[place].mean(), east - east[place].mean())
    stages = list[HeldStage]()
    for what, change in zip(STAGES, PLAN, strict=True):
        since = truth.t - began - change.at
        whole, settled = (since > 0.0) & (since < STAGE_S), (since > SETTLES_S) & (since < STAGE_S)
        stages.append(HeldStage(what, off[whole].max(), float(np.quantile(off[settled], 0.95))))
    return StationFlight(name, stages, judge_way(truth, let_go))


def table_of(flight: StationFlight) -> str:
    lines = [
        f"{flight.name}: {stage.what}: at most {1e3 * stage.most:.0f} mm from the place, "
        f"settled 95 % within {1e3 * stage.settled:.0f} mm"
        for stage in flight.stages
    ]
    stop = flight.stop
    lines.append(
        f"{flight.name}: surge let go at {stop.speed:.2f} m/s: {1e3 * stop.stopping:.0f} mm, of it "
        f"{1e3 * stop.bounce:.0f} mm beyond the rest, then {1e3 * stop.short:.0f} mm short of it"
    )
    return "\n".join(lines)
