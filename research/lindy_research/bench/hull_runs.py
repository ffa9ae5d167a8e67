"""Dives of hulls that differ from what their vehicle file says. The controller knows the file
only; the simulator has the hull (services/simulator/hull.py).
"""

from collections.abc import Sequence
from functools import cache
from math import degrees
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lindy.api.dives import Stack
from lindy.api.messages import Vec6
from lindy.api.vehicle import Vehicle
from lindy_research.dives import DEEP, Dive
from lindy_research.releases import QUIET_S, random_sticks


class HullDifference(NamedTuple):
    """A hull, as factors of what the vehicle file says, and what is added to it."""

    mass: float = 1.0  # [-] and inertia, and added mass
    damping: float = 1.0  # [-] linear and quadratic
    thrust: float = 1.0  # [-]
    lag: float = 1.0  # [-] of the thrusters
    buoyancy: float = 0.0  # [-] of `BUOYANCY`, more than in the file
    gravity_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m] FRD


BUOYANCY = {"pioneer": 5.0, "bluerov2_heavy": 17.0, "minerva": 55.0}  # [N] 1/7 of heave thrust
BALLAST_S = 0.8  # [s] after arming, before the first move, a heavier hull gets its weight
SHIFT = 0.005  # [m] of the centre of gravity

# The lines of the table; every dive of a line is flown with each of its hulls.
HULLS: dict[str, tuple[HullDifference, ...]] = {
    "nominal": (HullDifference(),),
    "mass and added mass ±30 %": (HullDifference(mass=0.7), HullDifference(mass=1.3)),
    "damping ×½, ×2": (HullDifference(damping=0.5), HullDifference(damping=2.0)),
    "thrust ±20 %": (HullDifference(thrust=0.8), HullDifference(thrust=1.2)),
    "thrust −40 %": (HullDifference(thrust=0.6),),
    "lag ×2": (HullDifference(lag=2.0),),
    "buoyancy ±, centre of gravity 5 mm off": (
        HullDifference(buoyancy=1.0, gravity_shift=(SHIFT, 0.0, 0.0)),
        HullDifference(buoyancy=-1.0, gravity_shift=(0.0, SHIFT, 0.0)),
    ),
    "mass −30 %, damping ×½, thrust +20 %, lag ×2": (HullDifference(0.7, 0.5, 1.2, 2.0),),
}


class HullGoals(NamedTuple):
    """Of the worst stop of a line."""

    bounce: float  # [mm]
    last_bounce: float  # [mm] of the last line
    overshoot: float  # [deg]
    heading: float = 3.0  # [deg] largest heading error at 60 % of the thrust


# Those of the other vehicles are the Pioneer's, times its thrust per inertia over theirs: in heave
# 35 N on 19.9 kg, 122 N on 32.2 kg and 390 N on 786 kg; in yaw 6.0 N m on 0.375 kg m², 23 N m on
# 0.592 kg m² and 140 N m on 107 kg m².
GOALS = {
    "pioneer": HullGoals(40.0, 70.0, 1.0),
    "bluerov2_heavy": HullGoals(19.0, 33.0, 0.41),
    "minerva": HullGoals(142.0, 249.0, 12.0),
}


class HullDive(NamedTuple):
    """One dive with random sticks, judged by the simulator's truth."""

    bounces: tuple[float, ...]  # [mm] of heave, at every stop
    overshoots: tuple[float, ...]  # [deg] of yaw, at every stop
    depth_error: float  # [mm] largest, reference minus truth, less the sensor's offset
    heading_error: float  # [deg] the same


def fly(
    vehicle: str, difference: HullDifference, seed: int, overrides: Sequence[str] = ()
) -> HullDive:
    """A minute of random sticks, as of `releases.py`."""
    rows, ends = random_sticks(seed, 60.0)
    over = ends[-1][0] + QUIET_S
    heavier = difference.buoyancy < 0.0  # it would sink before it is armed
    hull = settings(vehicle, difference._replace(buoyancy=0.0) if heavier else difference)
    dive = Dive(rows, vehicle=vehicle, seed=seed, overrides=(DEEP, *hull, *overrides))
    if heavier:
        dive.until(BALLAST_S).become(*settings(vehicle, difference))
    dive.until(over)
    off_depth, off_heading = dive.errors()
    true_depth, true_heading = dive.depth(), dive.heading()
    depth = dive.wanted_depth() - true_depth - np.median(off_depth)
    heading = dive.wanted_heading() - true_heading - np.median(off_heading)
    return HullDive(
        bounces=tuple([1e3 * _past(true_depth, t, sticks[2]) for t, sticks, _ in ends]),
        overshoots=tuple([degrees(_past(true_heading, t, sticks[3])) for t, sticks, _ in ends]),
        depth_error=1e3 * float(np.abs(depth).max()),
        heading_error=degrees(float(np.abs(heading).max())),
    )


def settings(vehicle: str, difference: HullDifference) -> list[str]:
    """The overrides that give the simulator this hull, and nobody else."""
    v, d = file_of(vehicle), difference
    hull: dict[str, object] = {}
    if d.mass != 1.0:
        hull["mass"] = d.mass * v.mass
        hull["inertia"] = [d.mass * part for part in v.inertia]
        hull["added_mass"] = _times(d.mass, v.added_mass)
    if d.damping != 1.0:
        hull["linear_damping"] = _times(d.damping, v.linear_damping)
        hull["quadratic_damping"] = _times(d.damping, v.quadratic_damping)
    if d.lag != 1.0:
        hull["time_constant"] = d.lag * max(t.time_constant for t in v.thruster)
    if d.buoyancy != 0.0:
        hull["net_buoyancy"] = v.net_buoyancy + d.buoyancy * BUOYANCY[vehicle]
    if any(d.gravity_shift):
        hull["gravity_shift"] = list(d.gravity_shift)
    if d.thrust != 1.0:
        hull["thrust_scale"] = d.thrust
    return [f"simulator.hull.{key}={value}" for key, value in hull.items()]


@cache
def file_of(vehicle: str) -> Vehicle:
    return Stack(vehicle=vehicle).section("vehicle", Vehicle)


def _times(factor: float, six: Vec6) -> list[float]:
    return [factor * part for part in six]


def _past(way: NDArray[np.float64], release: float, stick: float) -> float:
    """From the furthest point after a `release` [s] to where it settles, the mean of the last of
    the quiet seconds; 0 for a stick that was centred."""
    quiet = way[round(100 * release) : round(100 * (release + QUIET_S))] * np.sign(stick)
    return float(quiet.max() - quiet[-100:].mean())
