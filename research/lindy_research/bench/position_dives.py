"""Dives of a BlueROV2 Heavy with a DVL A50 on virtual time: a place held, stops over ground, a
rough sea floor below, a lock that is lost or wrong. Truth beside reference, of seeds that tuned
nothing.
"""

from math import hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lindy.api.messages import topics
from lindy_research.dives import HANDS_OFF, Dive, Row, Stick
from services.simulator.settings import Settings as Place
from services.simulator.surroundings import sea_floor
from services.simulator.terrain import Terrain

Floats = NDArray[np.float64]
VEHICLE, DVL, FLOOR = "bluerov2_heavy", "sensors.dvl=a50", 25.0  # [m] deep
CURRENTS: dict[str, tuple[str, ...]] = {
    "still water": (),
    "0.4 m/s": ("simulator.current.north=0.3", "simulator.current.east=-0.26"),
    "gusts": (
        "simulator.current.north=0.15",
        "simulator.current.std=0.1",
        "simulator.current.time_constant=15",
    ),
}
FULL: dict[str, Stick] = {
    "surge": (1.0, 0.0, 0.0, 0.0),
    "sway": (0.0, 1.0, 0.0, 0.0),
    "both, in a turn": (-0.7, 0.7, 0.0, 0.3),
}
DOWN: list[Row] = [(0.5, (0.0, 0.0, 0.6, 0.0)), (8.0, HANDS_OFF)]
HELD, REST = 30.0, 5.0  # [s] of a place that is held, of a rest by which it is judged
LEG = 4.0  # [s] of full stick
AWAY = 130.0  # [s] of full stick
LATE = 20.0  # [s] from here on it is near the ground
FLOOR_DISTANCE = 0.5  # [m] the vehicle file's


class HeldPlace(NamedTuple):
    p95: float  # [m] from where it was at first, reference and vehicle apart
    most: float  # [m]
    stops: tuple[tuple[float, float], ...]  # [m] back, and beyond the reference's rest; per stop


def sortie(seed: int, hands: list[Row], *more: str) -> Dive:
    overrides = (f"simulator.floor_depth={FLOOR}", DVL, *more)
    return Dive([*DOWN, *hands], vehicle=VEHICLE, seed=seed, overrides=overrides)


def held(seed: int, current: str) -> HeldPlace:
    """A place is held, then left and stopped at with each stick."""
    begins = [14.0 + HELD + k * (LEG + 10.0) for k in range(len(FULL))]
    hands = list[Row]()
    for begin, stick in zip(begins, FULL.values(), strict=True):
        hands += [(begin, stick), (begin + LEG, HANDS_OFF)]
    dive = sortie(seed, hands, *CURRENTS[current]).until(14.0)
    dive.hold("station_keeping")
    dive.until(begins[-1] + LEG + 9.0)
    t, place, wanted = _places(dive)
    away = place - wanted
    first = away[(t > 20.0) & (t < 20.0 + REST)].mean(axis=0)
    off = np.linalg.norm(away[(t > 20.0 + REST) & (t < 14.0 + HELD)] - first, axis=1)
    stops = tuple(_stopped(t, place, wanted, begin + LEG) for begin in begins)
    return HeldPlace(float(np.percentile(off, 95)), float(off.max()), stops)


def _stopped(t: Floats, place: Floats, wanted: Floats, release: float) -> tuple[float, float]:
    """[m] How far it comes back from its furthest point, and goes beyond the reference's rest."""
    i, j = np.searchsorted(t, (release, release + 7.5))
    way = wanted[j] - wanted[i]
    way /= hypot(*way)
    along, ends = place[i:j] @ way, (place[j - 50 : j] @ way).mean()
    beyond = (place[i:j] - wanted[j] - (place[j] - wanted[j])) @ way
    return float(along.max() - ends), float(beyond.max())


def moved_far_away(seed: int) -> float:
    """[m] How far it moves while it keeps its place for two minutes, forty metres away."""
    hands = [(20.0, FULL["surge"]), (20.0 + AWAY, HANDS_OFF)]
    flow = ("simulator.current.north=0.2", "simulator.current.east=-0.2")
    dive = sortie(seed, hands, *flow).until(14.0)
    dive.hold("station_keeping")
    dive.until(20.0 + AWAY + 130.0)
    t, place, _ = _places(dive)
    kept = place[t > 20.0 + AWAY + 10.0]
    return float(np.linalg.norm(kept - kept[0], axis=1).max())


def least_height(seed: int) -> float:
    """[m] Above hills, with the stick down and ahead; nobody measures the ground ahead."""
    rng = np.random.default_rng([seed, 9])
    hills, length = rng.uniform(0.3, 1.5), rng.uniform(12.0, 40.0)
    terrain = (f"simulator.terrain.hills={hills}", f"simulator.terrain.length={length}")
    ahead, turning = (0.7, 0.0, 0.4, 0.0), (0.7, 0.0, 0.0, 0.05)
    hands = [(8.1, (0.0, 0.0, 0.9, 0.0)), (34.0, ahead), (38.0, turning), (70.0, HANDS_OFF)]
    dive = sortie(seed, hands, *terrain, "simulator.floor_depth=12").until(15.0)
    dive.hold("altitude_hold")
    dive.until(74.0)
    floor = sea_floor(Place(floor_depth=12.0, terrain=Terrain(hills=hills, length=length)), seed)
    late = [m for m in dive.said(topics.TRUTH) if dive.when(m.stamp_ns) > LATE]
    return min(floor.depth(m.position) - m.position[2] for m in late)


def told_without_lock(seed: int) -> float:
    """[s] Until the drone says that it can no longer hold its position."""
    dive = sortie(seed, []).until(14.0)
    dive.hold("station_keeping")
    dive.until(20.0)
    dive.set_fault("sensor/dvl", "no_lock")
    while dive.mode == "station_keeping" and dive.seconds < 40.0:
        dive.until(dive.seconds + 0.1)
    return dive.seconds - 20.0


def moved_by_fish(seed: int) -> float:
    """[m] By which fish that pass for 2 s at 0.3 m/s move a drone that keeps its place."""
    dive = sortie(seed, []).until(14.0)
    dive.hold("station_keeping")
    dive.until(24.0)
    dive.set_fault("sensor/dvl", "wrong_lock", 0.3)
    dive.until(26.0)
    dive.set_fault("sensor/dvl", "none")
    dive.until(40.0)
    t, place, _ = _places(dive)
    before = place[(t > 23.0) & (t < 24.0)].mean(axis=0)
    return float(np.linalg.norm(place[t > 24.0] - before, axis=1).max())


def _places(dive: Dive) -> tuple[Floats, Floats, Floats]:
    """[s] since arming, [m] truth and reference north and east, where a place is held."""
    wanted = {m.stamp_ns // 10_000_000: m for m in dive.said(topics.REFERENCE)}
    rows = list[tuple[float, ...]]()
    for m in dive.said(topics.TRUTH):
        r = wanted.get(m.stamp_ns // 10_000_000)
        if r is not None and r.north is not None and r.east is not None:
            rows.append((dive.when(m.stamp_ns), *m.position[:2], r.north.position, r.east.position))
    found = np.array(rows)
    return found[:, 0], found[:, 1:3], found[:, 3:5]
