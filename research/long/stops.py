"""The thesis' promise, over many dives: no bounce back at the release of heave, no overshoot of a
turn. Run it as a script, for minutes: `python research/long/stops.py [SEEDS [FIRST]]`.

Each seed is a dive of the whole chain with its own noise, biases and random sticks. Every stop is
judged alike: from heave or yaw alone, with surge and sway let go at the same moment, or kept. The
line "by its estimate" is of the same dives: a vehicle that would hold exactly what it estimates.
Then a few dives each elsewhere: in a current, with a tether that pulls, on other
vehicles. Fails when a percentile is over its limit. Seeds that a setting was chosen with
are not for judging.
"""

import sys
from collections.abc import Iterable
from functools import partial
from math import degrees
from typing import NamedTuple

import numpy as np

from lindy_research.bench.hull_runs import GOALS
from lindy_research.releases import FINE, ReleaseResult, releases
from tools.sweep.all_cores import in_order

SEEDS, FIRST = 100, 0
SHARE = 10  # of the dives, one is flown in each of the other circumstances
CURRENT = (
    "simulator.current.north=0.2",
    "simulator.current.std=0.05",
    "simulator.current.time_constant=20",
)
TETHER = ("simulator.tether.slack=5",)
ELSEWHERE: dict[str, tuple[str, tuple[str, ...]]] = {  # vehicle, overrides
    "a current of 0.2 m/s": ("pioneer", CURRENT),
    "a current and a tether": ("pioneer", (*CURRENT, *TETHER)),
    "bluerov2_heavy": ("bluerov2_heavy", ()),
    "minerva": ("minerva", ()),
}
SIDES = ("centred", "released", "kept")
PERCENTILES = (50, 95, 99, 100)
INF = float("inf")


class Limits(NamedTuple):
    """What is judged, and the largest allowed at each percentile."""

    axis: str
    what: str
    unit: str
    factor: float  # from SI units
    most: tuple[float, float, float, float]


HEAVE = Limits("heave", "bounce back", "mm", 1e3, (INF, 22.0, 28.0, 35.0))
FINE_HEAVE = HEAVE._replace(most=(INF, INF, 8.0, INF))
YAW = Limits("yaw", "overshoot", "deg", degrees(1.0), (INF, INF, 0.3, INF))


def main(count: int, first: int) -> int:
    seeds = range(first, first + count)
    coarse = [release for dive in in_order(releases, seeds) for release in dive]
    fine = [release for dive in in_order(with_a_fine_sensor, seeds) for release in dive]
    print(
        f"{count} dives from seed {first} on of the Pioneer, random sticks, depth sensor of 5 mbar:"
        " 50 / 95 / 99 / 100 %"
    )
    broken = _show(coarse, YAW) + _show(coarse, HEAVE)
    print("the same with a depth sensor of 1 mbar")
    broken += _show(fine, FINE_HEAVE)
    broken += sum(_elsewhere(name, range(first, first + -(-count // SHARE))) for name in ELSEWHERE)
    print(f"{broken} limits broken")
    return int(broken > 0)


def with_a_fine_sensor(seed: int) -> list[ReleaseResult]:
    return releases(seed, overrides=FINE)


def _elsewhere(name: str, seeds: range) -> int:
    """Returns how many limits are broken. Those of another vehicle are the Pioneer's, by thrust per
    inertia (hull_runs.py)."""
    vehicle, overrides = ELSEWHERE[name]
    fly = partial(releases, vehicle=vehicle, overrides=overrides)
    found = [release for dive in in_order(fly, seeds) for release in dive]
    ours, its = GOALS["pioneer"], GOALS[vehicle]
    print(f"{name}, {len(seeds)} dives")
    return sum(
        _line(_scaled(limits, share), "all of them", [r for r in found if r.axis == limits.axis])
        for limits, share in (
            (HEAVE, its.bounce / ours.bounce),
            (YAW, its.overshoot / ours.overshoot),
        )
    )


def _scaled(limits: Limits, share: float) -> Limits:
    p50, p95, p99, most = [share * limit for limit in limits.most]
    return limits._replace(most=(p50, p95, p99, most))


def _show(found: list[ReleaseResult], limits: Limits) -> int:
    """Returns how many limits are broken."""
    for side in SIDES:
        these = [r for r in found if r.axis == limits.axis and r.horizontal == side]
        _line(limits, f"surge and sway {side}", these)
    return _line(limits, "all of them", [r for r in found if r.axis == limits.axis])


def _line(limits: Limits, which: str, these: list[ReleaseResult]) -> int:
    """Returns how many limits are broken."""
    done, known = (
        limits.factor * np.percentile(sizes, PERCENTILES)
        for sizes in ([r.overshoot for r in these], [r.by_estimate for r in these])
    )
    broken = [
        f"{percent} % over {most:g} {limits.unit}"
        for percent, size, most in zip(PERCENTILES, done, limits.most, strict=True)
        if size > most
    ]
    print(
        f"{limits.axis:5s} {limits.what:11s} {which:23s} {len(these):4d} stops: "
        f"{_listed(done)} {limits.unit}; by its estimate {_listed(known)}"
        + "".join(f"; {text}" for text in broken)
    )
    return len(broken)


def _listed(sizes: Iterable[float]) -> str:
    return " / ".join(f"{size:.2f}" for size in sizes)


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:3]]
    sys.exit(main(*given, *(SEEDS, FIRST)[len(given) :]))
