"""Hours of dives with one random fault after another: is the pilot in control again after each, was
each said, and does anything grow? `python -m tests.long.soak HOURS FAULTS SEED`.

On virtual time, one dive for each core, in one process each. The dives and faults are those of the
fault matrix (tests/support/faults), with random sticks, modes and depths. Prints every miss with
what repeats it, then a table by the cause of the faults, and what grew.
"""

import argparse
import os
import random
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from statistics import linear_regression, median
from typing import Any, NamedTuple

from services.runtime.os import system
from tests.support.faults.catalogue import FAULTS, NONE, FaultCase, FlownMode
from tests.support.faults.cells import in_copies
from tests.support.faults.figures import Figures, figures
from tests.support.faults.goals import JERK
from tests.support.faults.virtual_dive import SECOND, VirtualDive

MODES = ("manual", "depth_hold", "stabilised")
STICKS_S, DEPTH_S, MODE_S = 3, 60, 600  # [s] between two stick positions, depths, modes
CENTRED_S = 12  # [s] between two times with centred sticks, without which nothing arms
LOOK_S = 0.5  # [s] between two looks for who is in control, and for which he must be
LONGEST_BACK_S = 60.0  # [s] after the end of a fault, for the pilot to be in control again
ARM_S = 1.0  # [s] between two requests to arm, of a drone that a fault has disarmed
YOUNG, LEAST_H = 1 / 3, 0.05  # share of a process' life in which it fills; [h] of it that tell
MOST_COUNTS = 500  # names that a service may count
SETTINGS = ("simulator.battery_capacity=100000",)  # [Wh] the battery is empty when a fault says so
PAGE = os.sysconf("SC_PAGE_SIZE")  # [B]
WHAT = ("memory [MB]", "descriptors", "threads")
PER_HOUR = 8.0, 6.0, 6.0  # that a process may grow
WHOLE = 3.0  # a growth below it is none: it may be chance


class Judged(NamedTuple):
    """What came of one fault."""

    name: str
    cause: str
    misses: tuple[str, ...]
    said: bool
    back_s: float | None  # [s] after its end until the pilot was in control; None: he was not


class Soaked(NamedTuple):
    """One dive."""

    seed: int
    judged: list[Judged]
    hours: float
    grown: list[str]  # too fast
    restarts: int


def sticks(seconds: float, chance: random.Random) -> Iterator[str]:
    """Rows of a stick log: other sticks every few seconds, another depth or mode at times."""
    yield "0,0,0,0,0,,"
    yield "0.5,0,0,1,0,,"
    for second in range(5, round(seconds), STICKS_S):
        surge, sway, yaw = (chance.choice([0.0, chance.uniform(-1, 1)]) for _ in range(3))
        event = ""
        if second % CENTRED_S < STICKS_S:
            surge = sway = yaw = 0.0
        if second % MODE_S < STICKS_S:
            event = f"mode {chance.choice(MODES)}"
        elif second % DEPTH_S < STICKS_S:
            event = f"goto depth={chance.uniform(1.0, 4.0):.1f}"
        yield f"{second},{surge:.2f},{sway:.2f},0,{yaw:.2f},,{event}"


def fly(hours: float, number: int, seed: int) -> Soaked:
    """One dive with so many faults, one after the other, at equal intervals where they allow it."""
    chance = random.Random(seed)
    lasts = 3600.0 * (2.0 * hours + 1.0)  # they may take longer than that
    rows = tuple(sticks(lasts, chance))
    mode = FlownMode("soak", "pioneer", rows, 10.0, holds_depth=False, lasts=lasts)
    faults = [fault for fault in FAULTS if fault is not NONE]
    judged, seen, most = list[Judged](), list[tuple[float, ...]](), 0
    with closing(VirtualDive(mode, seed, SETTINGS)) as dive:
        start = dive.now
        for done in range(number):
            dive.run(max(1.0, 3600.0 * hours / number * done - (dive.now - start) / SECOND))
            at_s = (dive.now - start) / SECOND
            judged.append(one := judge(dive, chance.choice(faults)))
            for miss in one.misses:
                print(f"seed {seed}, fault {done} at {at_s:.0f} s, {one.name}: {miss}", flush=True)
            dive.seen.forget()
            most = max(most, *(len(node.counts) for node in dive.host.nodes.values()))
            seen.append(((dive.now - start) / SECOND / 3600.0, *sample()))
        flown_h = (dive.now - start) / SECOND / 3600.0
        restarts = sum(dive.restarts.values())
    grown = [*growths(seen), *([f"{most} names are counted"] if most > MOST_COUNTS else [])]
    return Soaked(seed, judged, flown_h, grown, restarts)


def sample() -> tuple[float, ...]:
    """Of this process, by WHAT."""
    folder = Path("/proc/self")
    rss_mb = int((folder / "statm").read_text().split()[1]) * PAGE / 1e6
    return rss_mb, *(float(sum(1 for _ in (folder / kind).iterdir())) for kind in ("fd", "task"))


def growths(seen: Sequence[tuple[float, ...]]) -> Iterator[str]:
    """What of the process grew too fast, by its regression line over the later part of its life."""
    later = seen[round(YOUNG * len(seen)) :]
    hours = later[-1][0] - later[0][0]
    if len(later) < 3 or hours < LEAST_H:
        return
    at, *values = zip(*later, strict=True)
    for what, most, each in zip(WHAT, PER_HOUR, values, strict=True):
        slope, _ = linear_regression(at, each)
        if slope > most and slope * hours > WHOLE:
            yield f"{what} {slope:+.1f} per hour, {slope * hours:+.1f} in all"


def judge(dive: VirtualDive, fault: FaultCase) -> Judged:
    """Let a fault happen, and wait until the pilot is in control again."""
    begin = dive.now
    fault.begin(dive)
    dive.run(fault.flown)
    fault.end(dive)
    found, back_s = until_back(dive, begin, dive.now)
    misses = tuple(missed(fault, found, back_s))
    return Judged(fault.name, fault.cause, misses, found.announced is not None, back_s)


def until_back(dive: VirtualDive, begin: int, ended: int) -> tuple[Figures, float | None]:
    """What was seen until the pilot was in control for `LOOK_S`, and how long that took."""
    asked = ended
    while True:
        dive.run(LOOK_S)
        found, now = figures(dive.seen, begin, dive.now, holds_depth=False), dive.now
        since = None if found.recovered is None else begin + round(found.recovered * SECOND)
        if since is not None and now - since >= LOOK_S * SECOND:
            return found, max(0.0, (since - ended) / SECOND)
        if now - ended > LONGEST_BACK_S * SECOND:
            return found, None
        if not found.still_armed and now - asked > ARM_S * SECOND:
            asked = now
            dive.ask(kind="arm")


def missed(fault: FaultCase, found: Figures, back_s: float | None) -> Iterator[str]:
    """What must not be. A fault that nobody reads is harmless where the pilot kept control."""
    if back_s is None:
        yield f"not in control after {LONGEST_BACK_S:.0f} s: {'; '.join(found.texts[-3:])}"
    if found.announced is None and found.recovered != 0.0:
        yield "not said, and control was lost"
    if found.stale:
        yield f"{found.stale} actuations of expired commands"
    if found.jerk_ratio is not None and found.jerk_ratio > JERK:
        yield f"jerk {found.jerk_ratio:.3f} of its limit"
    others = [name for name in found.restarted if name not in fault.name]
    if others and "memory lost" not in fault.name:  # all that it kills are started again
        yield f"started again: {', '.join(others)}"


def show(dives: Sequence[Soaked]) -> bool:
    """Print the table. Returns whether all is well."""
    judged = [one for dive in dives for one in dive.judged]
    print(f"\n{sum(d.hours for d in dives):.1f} hours of dives, {len(judged)} faults\n")
    print(f"{'cause':16} {'faults':>6} {'said':>5} {'harmless':>8} {'missed':>6} {'back [s]':>14}")
    for cause in dict.fromkeys(one.cause for one in judged):
        ones = [one for one in judged if one.cause == cause]
        back = [one.back_s for one in ones if one.back_s is not None]
        took = f"{median(back):.1f}, max {max(back):.1f}" if back else "–"
        said, bad = sum(one.said for one in ones), sum(bool(one.misses) for one in ones)
        print(f"{cause:16} {len(ones):6} {said:5} {len(ones) - said:8} {bad:6} {took:>14}")
    kinds = Counter(f"{one.name}: {miss}" for one in judged for miss in one.misses)
    for words, times in kinds.most_common():
        print(f"{times} × {words}")
    for dive in dives:
        print(f"seed {dive.seed}: {'; '.join(dive.grown) or 'nothing grew'}")
    return not kinds and not any(dive.grown for dive in dives)


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="soak", description=__doc__)
    parser.add_argument("hours", type=float)
    parser.add_argument("faults", type=int)
    parser.add_argument("seed", type=int)
    args = parser.parse_args(words)
    many = system.cores()
    share = args.hours / many, args.faults // many
    jobs = ((seed, partial(fly, *share, seed)) for seed in range(args.seed, args.seed + many))
    dives: list[Any] = [found for _, found in in_copies(jobs, many)]
    return 0 if show(dives) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
