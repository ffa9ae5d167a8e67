"""Honest timing of small things beside each other."""

import time
from collections.abc import Callable

REPEATS = 60


def race(*contenders: Callable[[], int], repeats: int = REPEATS) -> list[float]:
    """[ns] Best time per step of each contender; each returns the number of steps it made.

    They take turns, so whatever else the machine does hits all of them, and the best of many
    short turns is the one that was least disturbed.
    """
    best = [float("inf")] * len(contenders)
    for _ in range(repeats):
        for k, contender in enumerate(contenders):
            began = time.perf_counter_ns()
            steps = contender()
            best[k] = min(best[k], (time.perf_counter_ns() - began) / steps)
    return best
