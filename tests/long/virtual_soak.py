"""Hours of virtual dives with one random fault after another: is the pilot in control again after
each, was each said, and does anything grow? Run it as a script:
`python -m tests.long.virtual_soak [HOURS] [FAULTS] [SEED] [WORKERS]`.

The dives are those of the fault matrix (tests/support/faults), with random sticks, modes and
depths; each worker flies an equal share of the hours in one dive, in one process. Prints how it
gets on and every miss with what repeats it, then a table by the cause of the faults.
"""

import gc
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from statistics import median

import msgspec

from services.runtime.os import system
from tests.long.soak import PAGE, growth
from tests.support.faults.catalogue import FAULTS, NONE
from tests.support.faults.copies import in_copies
from tests.support.faults.fault import FaultCase
from tests.support.faults.figures import Figures, figures
from tests.support.faults.goals import JERK
from tests.support.faults.modes import FlownMode
from tests.support.faults.virtual_dive import SECOND, VirtualDive

HOURS, NUMBER, SEED = 8.0, 1000, 1
RANDOM = tuple(fault for fault in FAULTS if fault.virtual is not None and fault is not NONE)
MODES = ("manual", "depth_hold", "stabilised")
STICKS_S, DEPTH_S, MODE_S = 3, 60, 600  # [s] between two stick positions, depths, modes
CENTRED_S = 12  # [s] between two times with centred sticks, without which nothing arms
LOOK_S = 0.5  # [s] between two looks for who is in control, and for which he must be
LONGEST_BACK_S = 60.0  # [s] after the end of a fault, for the pilot to be in control again
ARM_S = 1.0  # [s] between two requests to arm, of a drone that a fault has disarmed
LEAST_H = 0.5  # [h] of a dive that tell whether memory grows
MEMORY_MB_H = 8.0  # [MB/h] that a process with all services may grow, in an hour of virtual time
MOST_COUNTS = 500  # names that a service may count
SETTINGS = ("simulator.battery_capacity=100000",)  # [Wh] the battery is empty when a fault says so


class Judged(msgspec.Struct, frozen=True, kw_only=True):
    """What came of one fault."""

    name: str
    cause: str
    at_s: float  # [s] since the dive began
    misses: tuple[str, ...]
    said: bool
    back_s: float | None  # [s] after its end until the pilot was in control; None: he was not


class Flown(msgspec.Struct, frozen=True, kw_only=True):
    """One dive."""

    judged: list[Judged]
    hours: float  # of virtual time
    wall_s: float
    memory: list[tuple[float, float]]  # ([h] of virtual time, [MB] of the process)
    counts: int  # names that the services counted, at most at one time
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


def fly(hours: float, number: int, seed: int) -> Flown:
    """One dive with so many faults, one after the other, at equal intervals where they allow it.

    Raises:
        Exception: of a service: its process would have ended by itself.
    """
    chance, began = random.Random(seed), time.monotonic()
    every_s = 3600.0 * hours / number
    lasts = 3600.0 * (2.0 * hours + 1.0)  # they may take longer than that
    mode = FlownMode(
        "soak", "pioneer", tuple(sticks(lasts, chance)), 10.0, holds_depth=False, lasts=lasts
    )
    judged: list[Judged] = []
    memory: list[tuple[float, float]] = []
    most = 0
    with closing(VirtualDive(mode, seed, SETTINGS)) as dive:
        start = dive.now
        for done in range(number):
            dive.run(max(1.0, every_s * done - (dive.now - start) / SECOND))
            judged.append(one := judge(dive, chance.choice(RANDOM), start))
            for miss in one.misses:
                print(f"seed {seed}, fault {done} at {one.at_s:.0f} s, {one.name}: {miss}")
            dive.seen.forget()
            most = max(most, *(len(node.counts) for node in dive.host.nodes.values()))
            gc.collect()
            flown_h = (dive.now - start) / SECOND / 3600.0
            memory.append((flown_h, rss_mb()))
            if (done + 1) % 10 == 0:
                misses = sum(bool(one.misses) for one in judged)
                print(
                    f"seed {seed}: {flown_h:.2f} h, {done + 1} faults, {misses} with a miss, "
                    f"{memory[-1][1]:.0f} MB, {time.monotonic() - began:.0f} s",
                    flush=True,
                )
        end, restarts = dive.now, sum(dive.restarts.values())
    return Flown(
        judged=judged, hours=(end - start) / SECOND / 3600.0, wall_s=time.monotonic() - began,
        memory=memory, counts=most, restarts=restarts,
    )  # fmt: skip


def rss_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE / 1e6


def judge(dive: VirtualDive, fault: FaultCase, start: int) -> Judged:
    """Let a fault happen, and wait until the pilot is in control again."""
    assert fault.virtual is not None
    begin = dive.now
    fault.virtual.begin(dive)
    dive.run(fault.flown)
    fault.virtual.end(dive)
    ended = dive.now
    found, back_s = until_back(dive, begin, ended)
    return Judged(
        name=fault.name, cause=fault.cause, at_s=(begin - start) / SECOND,
        misses=tuple(missed(fault, found, back_s)), said=found.announced is not None,
        back_s=back_s,
    )  # fmt: skip


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


def show(dives: Sequence[Flown], seeds: Sequence[int]) -> bool:
    """Print the table. Returns whether all is well."""
    judged = [one for dive in dives for one in dive.judged]
    hours, longest = sum(d.hours for d in dives), max(d.wall_s for d in dives)
    print(f"\n{hours:.1f} hours of dives, {len(judged)} faults, {longest / 60.0:.1f} min\n")
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
    grows = False
    for seed, dive in zip(seeds, dives, strict=True):
        words, too_fast = memory_words(dive)
        grows = grows or too_fast or dive.counts > MOST_COUNTS
        print(f"seed {seed}: {words}; {dive.restarts} restarts; {dive.counts} names are counted")
    return not kinds and not grows


def memory_words(dive: Flown) -> tuple[str, bool]:
    """How the memory of a dive's process grew, in words, and was it too fast? The first third is
    left out, in which what is kept in bounds fills."""
    at, mb = zip(*dive.memory[len(dive.memory) // 3 :], strict=True)
    if dive.hours < LEAST_H:
        return f"{mb[-1]:.0f} MB", False
    grown = growth("dive", "memory [MB]", [3600.0 * h for h in at], mb)
    too_fast = grown.per_hour > MEMORY_MB_H
    words = f"{mb[-1]:.0f} MB, {grown.per_hour:+.2f} MB per hour"
    return f"{words}{'  TOO FAST' if too_fast else ''}", too_fast


def main(hours: float, number: int, seed: int, workers: int) -> int:
    seeds = range(seed, seed + workers)
    flights = (
        (n, partial(_encoded, hours / workers, number // workers, s)) for n, s in enumerate(seeds)
    )
    found = dict(in_copies(flights, workers))
    dives = [msgspec.json.decode(found[n], type=Flown) for n in range(workers)]
    return 0 if show(dives, seeds) else 1


def _encoded(hours: float, number: int, seed: int) -> bytes:
    return msgspec.json.encode(fly(hours, number, seed))


if __name__ == "__main__":
    given = [float(word) for word in sys.argv[1:]]
    defaults = [HOURS, NUMBER, SEED, system.cores()]
    hours, *whole = [*given, *defaults[len(given) :]]
    sys.exit(main(hours, *map(int, whole)))
