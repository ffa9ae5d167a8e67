"""What a DVL gives a BlueROV2: how well a place is held and a stop over ground is exact, how near a
rough sea floor comes, and how soon a lost lock is said.

Baselines are the goals. `--quick` flies 10 terrains of 200. Two dives at a time.
"""

from collections.abc import Callable
from multiprocessing import get_context
from typing import TypeVar

from lindy_research.bench import position_dives as dives
from lindy_research.bench.table import Figure

SEEDS = range(500, 504)
TERRAINS, FEW_TERRAINS = range(1000, 1200), range(1000, 1010)
PLACE, BOUNCE = 0.1, 0.1  # [m]
TOLD = 5.2  # [s] 3 without a velocity, 2 of patience, and the latency
T = TypeVar("T")


def figures(*, quick: bool = False) -> list[Figure]:
    with get_context("spawn").Pool(2) as pool:

        def each(way: Callable[[int], T], seeds: range) -> list[T]:
            return pool.map(way, seeds, chunksize=1)

        found = list[Figure]()
        for current in dives.CURRENTS:
            flown = pool.starmap(dives.held, [(seed, current) for seed in SEEDS], chunksize=1)
            found.append(_judged(f"{current}: place, p95", max(one.p95 for one in flown), PLACE))
            found.append(_judged(f"{current}: place, most", max(one.most for one in flown), PLACE))
            for k, stick in enumerate(dives.FULL):
                back = max(one.stops[k][0] for one in flown)
                beyond = max(one.stops[k][1] for one in flown)
                found.append(_judged(f"{current}: stop of {stick}, back", back, BOUNCE))
                found.append(_judged(f"{current}: stop of {stick}, beyond", beyond, BOUNCE))
        moved = max(each(dives.moved_far_away, SEEDS))
        found.append(_judged("place held 2 min, 40 m away: moved", moved, PLACE))
        heights = each(dives.least_height, FEW_TERRAINS if quick else TERRAINS)
        broken = sum(height < dives.FLOOR_DISTANCE for height in heights)
        found.append(
            Figure(
                section="position",
                name=f"{len(heights)} terrains: least height",
                unit="m",
                ours=min(heights),
                baseline_name="floor_distance",
                baseline=dives.FLOOR_DISTANCE,
                note=f"nearer in {broken}",
            )
        )
        told = max(each(dives.told_without_lock, SEEDS))
        found.append(_judged("lock lost: told after", told, TOLD, "s"))
        fish = max(each(dives.moved_by_fish, SEEDS))
        found.append(_judged("fish at 0.3 m/s for 2 s: moved", fish, PLACE))
    return found


def _judged(name: str, ours: float, goal: float, unit: str = "m") -> Figure:
    return Figure(
        section="position", name=name, unit=unit, ours=ours,
        baseline_name="goal", baseline=goal, goal=1.0,
    )  # fmt: skip
