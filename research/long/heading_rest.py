"""A heading at rest: from 5 s after a turn on, hands off, it stays within 0.5 degrees of where it
is held. Run it as a script, for minutes: `python research/long/heading_rest.py [SEEDS [FIRST]]`.

Each seed is a dive of the Pioneer with its own noise and biases, a random turn with heave, and then
half a minute of rest, in which a heading within the thrusters' dead-band could drift off and swing.
Judged is what the drone knows of its heading: the true one drifts with the gyroscope's bias.
Fails when one dive is over the limit. Seeds that a setting was chosen with are not for judging.
"""

import sys
from math import degrees
from random import Random
from typing import NamedTuple

import numpy as np

from lindy_research.dives import DEEP, HANDS_OFF, Dive
from lindy_research.releases import HEAVE, YAW
from tools.sweep.all_cores import in_order

SEEDS, FIRST = 100, 0
LIMIT = 0.5  # [deg]
AFTER_S, REST_S = 5.0, 35.0  # [s] after the stick is let go: from when to when it is judged
TURN_S = (2.0, 7.0)  # [s] shortest and longest
PERCENTILES = (50, 95, 99, 100)


class Rest(NamedTuple):
    """Of one dive."""

    off: float  # [deg] furthest from the reference
    swing: float  # [deg] largest change of the true heading in 2 s


def rest(seed: int) -> Rest:
    chance = Random(seed)
    heave, yaw = abs(chance.choice(HEAVE)), chance.choice(YAW)  # down: it starts near the surface
    end = 1.0 + chance.uniform(*TURN_S)
    sticks = [(1.0, (0.0, 0.0, heave, yaw)), (end, HANDS_OFF)]
    dive = Dive(sticks, seed=seed, overrides=(DEEP,)).until(end + REST_S)
    begin = end + AFTER_S
    _, wrong = dive.errors(begin)
    true = dive.heading(begin)
    off = np.abs(true + wrong - dive.wanted_heading(begin)).max()
    swing = np.abs(true[200:] - true[:-200]).max()
    return Rest(degrees(off), degrees(swing))


def main(count: int, first: int) -> int:
    rests = in_order(rest, range(first, first + count))
    off, swing = np.transpose(rests)
    print(f"{count} dives from seed {first} on of the Pioneer, at rest: 50 / 95 / 99 / 100 %")
    for what, sizes in (("off its reference", off), ("swing in 2 s", swing)):
        print(f"{what}: {' / '.join(f'{x:.3f}' for x in np.percentile(sizes, PERCENTILES))} deg")
    broken = [f"{first + k} ({one.off:.2f})" for k, one in enumerate(rests) if one.off > LIMIT]
    print(f"{len(broken)} over {LIMIT:g} deg" + "".join(f"; seed {text}" for text in broken))
    return int(bool(broken))


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:3]]
    sys.exit(main(*given, *(SEEDS, FIRST)[len(given) :]))
