"""Many simulated dives as rough as real ones (reality_dives.py), on all cores, as a table:

    python -m lindy_research.bench.reality_sim --seeds 24 --first 500
    python -m lindy_research.bench.reality_sim --seed 517 --out bad.mcap
    python -m lindy_research.bench.reality_sim --case light

Seeds that a setting was chosen with are not for judging.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import degrees
from pathlib import Path

import numpy as np

from lindy.api import LindyError
from lindy_research.bench.reality_dives import (
    CASES,
    INCONSISTENT,
    NOISY,
    SECONDS,
    Errors,
    RoughDive,
    fly,
)
from tools.sweep.all_cores import on_all_cores

SEEDS, FIRST = 24, 500
PERCENTILES = (50, 90, 100)


# Name, unit, and the value of a dive.
ROWS: tuple[tuple[str, str, Callable[[Errors], float]], ...] = (
    ("depth rms, less its offset", "mm", lambda e: 1e3 * e.depth),
    ("depth offset", "mm", lambda e: 1e3 * abs(e.depth_offset)),
    ("depth rate rms", "mm/s", lambda e: 1e3 * e.depth_rate),
    ("roll rms", "deg", lambda e: degrees(e.roll)),
    ("pitch rms", "deg", lambda e: degrees(e.pitch)),
    ("NEES of depth", "", lambda e: e.nees_depth),
    ("NEES of depth rate", "", lambda e: e.nees_rate),
    ("NEES of tilt", "", lambda e: e.nees_tilt),
    ("without attitude", "%", lambda e: 100.0 * (1.0 - e.attitude)),
)


def flown(
    seeds: Sequence[int],
    case: str | None = None,
    seconds: float = SECONDS,
    hear: Callable[[RoughDive], None] = lambda _: None,
) -> list[RoughDive]:
    """In the order of the seeds, which may be given to `hear` in any order, as they are flown."""
    done = dict[int, RoughDive]()
    for result in on_all_cores(partial(fly, case=case, seconds=seconds), seeds):
        if result is not None:
            done[result[0]] = result[1]
            hear(result[1])
    return [done[index] for index in range(len(seeds))]


def line(dive: RoughDive) -> str:
    """A dive and what was found in it."""
    found = list[str]()
    if dive.errors is None:
        found.append("NEVER ARMED")
    found += [f"{name} ×{count}" for name, count in dive.counts.items() if count]
    found += [f"failsafe {name}" for name in dive.failsafes]
    if (e := dive.errors) is not None:
        found.append(
            f"depth {1e3 * e.depth:.0f} mm, rate {1e3 * e.depth_rate:.0f} mm/s, tilt "
            f"{degrees(e.roll):.2f}/{degrees(e.pitch):.2f}°, NEES {e.nees_depth:.2f} "
            f"{e.nees_rate:.2f} {e.nees_tilt:.2f}"
        )
    return f"{dive.seed:5d}  {dive.circumstances.words}: {'; '.join(found)}"


def table(dives: Sequence[RoughDive]) -> Iterator[str]:
    """What is wrong, what the estimator told besides, then errors and stops, in calm water and in
    waves."""
    yield f"{len(dives)} dives, of which with:"
    yield _which("never armed", dives, lambda d: not d.armed)
    for name in (INCONSISTENT, NOISY):
        yield _which(name, dives, lambda d, name=name: name in d.counts)
    yield _which("failsafe not by the link", dives, lambda d: bool(d.failsafes))
    for name in sorted({n for d in dives for n in d.counts} - {INCONSISTENT, NOISY}):
        yield _which(name, dives, lambda d, name=name: name in d.counts)
    for water, these in (
        ("calm", [d for d in dives if d.circumstances.waves is None]),
        ("waves", [d for d in dives if d.circumstances.waves is not None]),
    ):
        errors = [d.errors for d in these if d.errors is not None]
        if not errors:
            continue
        yield f"{water}, {len(errors)} dives: " + " / ".join(f"{p} %" for p in PERCENTILES)
        for name, unit, of in ROWS:
            yield _percentiles(name, unit, [of(e) for e in errors])
        yield from _stops(these)


def _which(name: str, dives: Sequence[RoughDive], wrong: Callable[[RoughDive], bool]) -> str:
    seeds = [d.seed for d in dives if wrong(d)]
    return f"  {name:28s} {len(seeds):3d}" + (f"  seeds {seeds}" if seeds else "")


def _stops(dives: Sequence[RoughDive]) -> Iterator[str]:
    heave = [(1e3 * s.bounce, d.seed, s) for d in dives for s in d.stops if s.bounce is not None]
    yaw = [
        (degrees(s.overshoot), d.seed, s) for d in dives for s in d.stops if s.overshoot is not None
    ]
    for name, unit, found in (("bounce of heave", "mm", heave), ("overshoot of yaw", "deg", yaw)):
        if found:
            _, seed, stop = max(found, key=lambda each: each[0])
            yield (
                _percentiles(name, unit, [size for size, *_ in found])
                + f"; {len(found)} stops, worst: seed {seed}, {stop.kind} until {stop.t:.1f} s"
            )
    rough = [stop for _, _, stop in heave if stop.orbit]
    if rough:
        name = "the water's own motion, 2σ"
        yield _percentiles(name, "mm", [1e3 * stop.orbit for stop in rough])
        yield _percentiles(
            "bounce over that",
            "",
            [stop.bounce / stop.orbit for stop in rough if stop.bounce is not None],
        )


def _percentiles(name: str, unit: str, values: Sequence[float]) -> str:
    listed = " / ".join(f"{value:.3g}" for value in np.percentile(values, PERCENTILES))
    return f"  {name:28s} {listed} {unit}".rstrip()


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="reality_sim", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--seeds", type=int, default=SEEDS, help="how many")
    parser.add_argument("--first", type=int, default=FIRST, help="the first of them")
    parser.add_argument("--seed", type=int, help="this one alone")
    parser.add_argument("--case", choices=sorted(CASES), help="a hull instead of those drawn")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of moves")
    parser.add_argument("--out", type=Path, help="recording of --seed, an MCAP file")
    given = parser.parse_args(words)
    least = given.first if given.seed is None else given.seed
    if least < 0 or given.seeds < 1 or not 1.0 <= given.seconds <= 3000.0:
        raise LindyError(
            f"--first and --seed are 0 or more, --seeds 1 or more, --seconds 1 to 3000, found "
            f"{least}, {given.seeds}, {given.seconds:g}"
        )
    if given.out is not None and given.seed is None:
        raise LindyError("--out is the recording of one dive: name it by --seed")
    if given.out is not None and (given.out.exists() or not given.out.absolute().parent.is_dir()):
        raise LindyError(f"--out {given.out}: it must be a new file in a folder that exists")
    if given.seed is not None:
        dives = [fly(given.seed, given.case, given.seconds, given.out)]
        print(line(dives[0]))
    else:
        seeds = range(given.first, given.first + given.seeds)
        dives = flown(seeds, given.case, given.seconds, lambda d: print(line(d), flush=True))
    print("\n".join(table(dives)))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except LindyError as error:
        sys.exit(str(error))
