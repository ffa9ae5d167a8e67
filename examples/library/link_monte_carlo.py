"""What each link does to sticks: delay percentiles and loss over many runs.

python examples/library/link_monte_carlo.py [PROFILE ...]
"""

import sys

import numpy as np

from lindy.api import DEPLOY, LindyError
from lindy.api.links import fates, named

RUNS, SECONDS = 20, 30.0
RATE, SIZE = 50.0, 120  # [1/s] messages, [B] each


def main(names: list[str]) -> None:
    print(f"{'profile':<12} {'p50':>8} {'p95':>8} {'p99':>8} [ms] {'lost':>7} [%]")
    for name in names or sorted(file.stem for file in (DEPLOY / "links").glob("*.toml")):
        down = named(name).profile.down
        delays: dict[tuple[int, int], float] = {}  # [s] of the first copy that arrives whole
        for seed in range(RUNS):
            for number, sent, at, why in fates(down, RATE, SIZE, SECONDS, seed):
                if at is not None and not why:
                    delays.setdefault((seed, number), at - sent)
        lost = 100.0 * (1.0 - len(delays) / (RUNS * RATE * SECONDS))
        p50, p95, p99 = np.percentile(list(delays.values()), [50, 95, 99]) * 1e3
        print(f"{name:<12} {p50:8.1f} {p95:8.1f} {p99:8.1f}      {lost:7.2f}")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except LindyError as error:
        sys.exit(str(error))
