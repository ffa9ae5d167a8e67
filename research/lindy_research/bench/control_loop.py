"""An integral or a disturbance observer? The whole chain on virtual time, with real estimates,
noise, dead-bands, limits and the tether, flown with each, from the same seeds.

The pilot dives, stops, turns, and stops; then the vehicle becomes 10 N lighter, as if a weight had
dropped (the simulator goes on with another file). In a second dive he pushes it onto the sea floor,
lets go, and lifts off.
"""

from collections.abc import Sequence
from statistics import fmean
from typing import NamedTuple

import numpy as np

from lindy.api.messages import topics
from lindy_research.bench.table import Figure
from lindy_research.dives import Dive, Floats

SEEDS = range(5)
INTEGRAL = ("control.depth.observer=0", "control.heading.observer=0")
LIGHTER = ("vehicle.net_buoyancy=11",)  # [N] instead of 1
STICKS = "t,surge,sway,heave,yaw\n"
DIVE = STICKS + "0,0,0,0,0\n2,0,0,0.8,0\n8,0,0,0,0\n15,0,0,0,0.5\n19,0,0,0,0\n90,0,0,0,0\n"
FLOOR = STICKS + "0,0,0,0,0\n2,0,0,1,0\n12,0,0,0,0\n18,0,0,-0.8,0\n22,0,0,0,0\n90,0,0,0,0\n"
DROP_S = 26.0  # [s] after arming the weight drops


class BenchDive(NamedTuple):
    """Rows of the truth and what was wanted then, at 100 Hz from arming on."""

    depth: Floats  # [m]
    heading: Floats  # [rad]
    wanted_depth: Floats  # [m]
    wanted_heading: Floats  # [rad]
    heave: Floats  # [N] command of the vertical thruster

    def between(self, begin: float, end: float) -> "BenchDive":
        """Seconds after arming."""
        return BenchDive(*[column[round(100 * begin) : round(100 * end)] for column in self])


class ControlScores(NamedTuple):
    following: float  # [mm] rms depth error while diving, its mean (a bias of the sensor) apart
    turning: float  # [deg] rms heading error while turning, its mean apart
    bounce: float  # [mm] back from the deepest point after the stop
    holding: float  # [mm] standard deviation of the depth at rest
    dropped: float  # [mm] furthest after the weight has dropped
    work: float  # [N²] Σ Δu² of the vertical thruster while holding
    pushing: float  # [N] on the sea floor, hands off
    lifting: float  # [mm] worst depth error when it lifts off


NAMES = {
    "following": ("depth error while diving, rms", "mm"),
    "turning": ("heading error while turning, rms", "deg"),
    "bounce": ("bounce back at release", "mm"),
    "holding": ("depth at rest, standard deviation", "mm"),
    "dropped": ("10 N of weight lost, furthest", "mm"),
    "work": ("unrest of the vertical thruster at rest", "N²"),
    "pushing": ("pushes on the sea floor, hands off", "N"),
    "lifting": ("lifts off the sea floor, worst error", "mm"),
}


def figures() -> list[Figure]:
    """The vehicle file's law beside the same with integrals."""
    ours, baseline = scores(()), scores(INTEGRAL)
    return [
        Figure(
            section="control",
            name=name,
            unit=unit,
            ours=getattr(ours, key),
            baseline_name="integral",
            baseline=getattr(baseline, key),
            note=f"mean of {len(SEEDS)} seeds",
        )
        for key, (name, unit) in NAMES.items()
    ]


def scores(overrides: Sequence[str], seeds: Sequence[int] = SEEDS) -> ControlScores:
    """Means over the seeds, of the Pioneer with these settings."""
    return ControlScores(
        *map(fmean, zip(*[_scored(overrides, seed) for seed in seeds], strict=True))
    )


def _scored(overrides: Sequence[str], seed: int) -> ControlScores:
    dive = flown(DIVE, 34.0, overrides, seed, drops=True)
    floor = flown(FLOOR, 26.0, [*overrides, "simulator.floor_depth=3"], seed)
    stop, rest = dive.between(8.0, 14.5), dive.between(11.0, 14.5)
    drop, calm = dive.between(DROP_S, 34.0), dive.between(DROP_S - 2.0, DROP_S)
    offset = float(np.mean(calm.wanted_depth - calm.depth))
    lift = floor.between(18.0, 24.0)
    return ControlScores(
        following=1e3 * _spread(dive.between(2.0, 9.0), "depth"),
        turning=float(np.degrees(_spread(dive.between(15.0, 20.0), "heading"))),
        bounce=1e3 * float(stop.depth.max() - rest.depth.mean()),
        holding=1e3 * float(rest.depth.std()),
        dropped=1e3 * float(np.abs(drop.wanted_depth - drop.depth - offset).max()),
        work=float(np.sum(np.diff(rest.heave) ** 2)),
        pushing=float(np.mean(floor.between(16.0, 18.0).heave)),
        lifting=1e3 * float(np.abs(lift.wanted_depth - lift.depth).max()),
    )


def _spread(part: BenchDive, axis: str) -> float:
    """Root mean square of the error without its mean."""
    return float(np.std(getattr(part, f"wanted_{axis}") - getattr(part, axis)))


def flown(
    script: str, seconds: float, overrides: Sequence[str], seed: int, *, drops: bool = False
) -> BenchDive:
    """A dive on virtual time, for `seconds` after arming."""
    dive = Dive(script, seed=seed, overrides=overrides)
    if drops:
        dive.until(DROP_S).become(*LIGHTER)
    dive.until(seconds)
    return BenchDive(
        depth=dive.column(topics.TRUTH, lambda m: m.position[2]),
        heading=dive.column(topics.TRUTH, lambda m: m.heading),
        wanted_depth=dive.column(topics.REFERENCE, lambda m: m.depth.position),
        wanted_heading=dive.column(topics.REFERENCE, lambda m: m.heading.position),
        heave=dive.column(topics.THRUSTERS, lambda m: m.thrust[-1]),
    )
