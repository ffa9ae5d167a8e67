"""The thesis' promise, over many dives: no bounce back at the release of heave, no overshoot of a
turn. Run it as a script, for minutes: `python tests/long/stops.py [SEEDS]`.

Each seed is a dive of the whole chain with its own noise, biases and random sticks. Prints worst
and percentiles, and fails when a stop from heave or yaw alone breaks its limit. Two things are
shown and not judged. Where surge and sway are let go at the same moment, or are kept on, the
vehicle pitches by up to 20 degrees and turns. And the sensor of 5 mbar makes the vehicle wander by
more than a stop does; what the stop itself does shows with a sensor of 1 mbar.
"""

import sys
from math import degrees

import numpy as np

from tools.research.bench.control_goals import FINE
from tools.research.bench.goal_runs import ReleaseResult, releases
from tools.sweep.all_cores import in_order

SEEDS = 100
SIDES = ("centred", "released", "kept")
# axis → what, unit, factor, limit
AXES = {
    "heave": ("bounce back", "mm", 1e3, 30.0),
    "yaw": ("overshoot", "deg", degrees(1.0), 1.0),
}


def main(seeds: int) -> int:
    coarse = [release for dive in in_order(releases, range(seeds)) for release in dive]
    fine = [release for dive in in_order(with_a_fine_sensor, range(seeds)) for release in dive]
    print(f"{seeds} dives of the Pioneer, random sticks, depth sensor of 5 mbar")
    overshoot = _show(coarse, "yaw")
    _show(coarse, "heave")
    print("the same with a depth sensor of 1 mbar")
    bounce = _show(fine, "heave")
    return int(overshoot + bounce > 0)


def with_a_fine_sensor(seed: int) -> list[ReleaseResult]:
    return releases(seed, overrides=FINE)


def _show(found: list[ReleaseResult], axis: str) -> int:
    """Returns how many releases of this stick alone were over the limit."""
    what, unit, factor, limit = AXES[axis]
    broken = 0
    for side in SIDES:
        sizes = _sizes(found, axis, side) * factor
        middle, most, p99 = np.percentile(sizes, [50, 95, 99])
        over = int(np.sum(sizes > limit))
        print(
            f"{axis:5s} {what:11s} surge and sway {side:8s} {len(sizes):4d} releases: median "
            f"{middle:.2f}, 95 % {most:.2f}, 99 % {p99:.2f}, worst {sizes.max():.2f} {unit}; "
            f"{over} over {limit:g} {unit}"
        )
        broken += over if side == "centred" else 0
    return broken


def _sizes(found: list[ReleaseResult], axis: str, side: str) -> np.ndarray:
    return np.array([r.overshoot for r in found if r.axis == axis and r.horizontal == side])


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS))
