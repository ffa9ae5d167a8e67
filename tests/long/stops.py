"""The thesis' promise, over many dives: no bounce back at the release of heave, no overshoot of a
turn. Run it as a script, for minutes: `python tests/long/stops.py [SEEDS [FIRST]]`.

Each seed is a dive of the whole chain with its own noise, biases and random sticks. Prints worst
and percentiles, and fails when a stop from heave alone breaks its limit, or more than one turn in
a hundred of all kinds. Two things are shown and not judged. Where surge and sway are let go at the
same moment as heave, or are kept on, the vehicle pitches by up to 20 degrees. And the sensor of
5 mbar makes the vehicle wander by more than a stop does; what the stop itself does shows with a
sensor of 1 mbar. The line "by its estimate" is of the same dives: a vehicle that would hold
exactly what it estimates.
"""

import sys
from math import degrees

import numpy as np

from tools.research.bench.control_goals import FINE
from tools.research.bench.goal_runs import ReleaseResult, releases
from tools.sweep.all_cores import in_order

SEEDS, FIRST = 100, 0
SIDES = ("centred", "released", "kept")
# axis → what, unit, factor, limit
AXES = {
    "heave": ("bounce back", "mm", 1e3, 30.0),
    "yaw": ("overshoot", "deg", degrees(1.0), 0.3),
}


def main(count: int, first: int) -> int:
    seeds = range(first, first + count)
    coarse = [release for dive in in_order(releases, seeds) for release in dive]
    fine = [release for dive in in_order(with_a_fine_sensor, seeds) for release in dive]
    print(
        f"{count} dives from seed {first} on of the Pioneer, random sticks, depth sensor of 5 mbar"
    )
    overshoot = _show(coarse, "yaw")
    _show(coarse, "heave")
    print("the same with a depth sensor of 1 mbar")
    bounce = _show(fine, "heave")
    return int(overshoot + bounce > 0)


def with_a_fine_sensor(seed: int) -> list[ReleaseResult]:
    return releases(seed, overrides=FINE)


def _show(found: list[ReleaseResult], axis: str) -> int:
    """Returns how many releases were over the limit: of heave those of this stick alone, of yaw
    all, less the one in a hundred that may be."""
    broken = 0
    for side in SIDES:
        these = [r for r in found if r.axis == axis and r.horizontal == side]
        over = _line(axis, f"surge and sway {side}", [r.overshoot for r in these])
        broken += over if side == "centred" else 0
    every = [r for r in found if r.axis == axis]
    over = _line(axis, "all of them", [r.overshoot for r in every])
    _line(axis, "by its estimate", [r.by_estimate for r in every])
    return max(0, over - len(every) // 100) if axis == "yaw" else broken


def _line(axis: str, which: str, sizes: list[float]) -> int:
    """Returns how many are over the limit."""
    what, unit, factor, limit = AXES[axis]
    shown = factor * np.array(sizes)
    middle, most, p99 = np.percentile(shown, [50, 95, 99])
    over = int(np.sum(shown > limit))
    print(
        f"{axis:5s} {what:11s} {which:23s} {len(shown):4d} releases: median {middle:.2f}, "
        f"95 % {most:.2f}, 99 % {p99:.2f}, worst {shown.max():.2f} {unit}; "
        f"{over} over {limit:g} {unit}"
    )
    return over


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:3]]
    sys.exit(main(*given, *(SEEDS, FIRST)[len(given) :]))
