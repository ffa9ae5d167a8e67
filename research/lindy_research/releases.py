"""Sticks let go at random: how far a vehicle comes back, by the simulator's truth, so that errors
of the sensors count; a constant offset of a sensor does not."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lindy_research.dives import DEEP, HANDS_OFF, Dive, Floats, Row, Stick

HEAVE, YAW = (-1.0, -0.6, -0.3, 0.3, 0.6, 1.0), (-1.0, -0.5, 0.5, 1.0)
QUIET_S = 5.0  # [s] hands off after every move
STOPPING = 140  # samples of 10 ms: 1.4 s, after which the reference rests at the latest
LEAST, MOST = 1.5, 20.0  # [m] the pilot turns round here
FULL_HEAVE = 0.5  # [m/s] more than any vehicle's
FULL = {"pioneer": 0.5, "bluerov2_heavy": 0.4, "minerva": 0.2}  # [m/s] at full heave stick
FINE = ("simulator.pressure_std=100", "estimation.depth.pressure_std=100")  # [Pa]


class ReleaseResult(NamedTuple):
    """A stick let go. Overshoot: from the furthest point to where it settles."""

    axis: str  # heave or yaw
    t: float  # [s] after arming
    horizontal: str  # surge and sway sticks: "centred" all the time, "kept" or "released" now
    overshoot: float  # [m] or [rad]
    by_estimate: float  # [m] or [rad] the same of a vehicle that would follow its estimate exactly


def random_sticks(seed: int, seconds: float) -> tuple[list[Row], list[tuple[float, Stick, str]]]:
    """Moves of 1.5 to 4 s with five quiet seconds after each, in half of which surge and sway go
    on. The second list: when a move ended, its sticks, and what surge and sway did then."""
    rng = np.random.default_rng([seed, 7])
    rows: list[Row] = []
    ends: list[tuple[float, Stick, str]] = []
    t, depth = 1.0, 0.0
    while t < seconds:
        wait = float(rng.uniform(1.5, 4.0)) if rows else 4.0
        heave = float(rng.choice(HEAVE)) if rows else 1.0
        if not LEAST <= depth + FULL_HEAVE * heave * wait <= MOST:
            heave = -heave
        depth += FULL_HEAVE * heave * wait
        yaw = float(rng.choice(YAW))
        surge, sway = rng.uniform(-1.0, 1.0, 2).round(2).tolist()
        horizontal = str(rng.choice(["centred", "kept", "released"]))
        if horizontal == "centred":
            surge = sway = 0.0
        rows.append((t, (surge, sway, heave, yaw)))
        t += wait
        rows.append((t, (surge, sway, 0.0, 0.0) if horizontal == "kept" else HANDS_OFF))
        ends.append((t, (surge, sway, heave, yaw), horizontal))
        t += QUIET_S
    return rows, ends


def releases(
    seed: int, seconds: float = 60.0, vehicle: str = "pioneer", overrides: Sequence[str] = ()
) -> list[ReleaseResult]:
    """Every release of a dive with random sticks."""
    rows, ends = random_sticks(seed, seconds)
    dive = Dive(rows, vehicle=vehicle, seed=seed, overrides=(DEEP, *overrides))
    dive.until(ends[-1][0] + QUIET_S)
    found: list[ReleaseResult] = []
    for t, (_, _, heave, yaw), horizontal in ends:
        off_depth, off_heading = dive.errors(t, t + QUIET_S)
        for axis, way, off, stick in (
            ("heave", dive.depth(t, t + QUIET_S), off_depth, heave),
            ("yaw", dive.heading(t, t + QUIET_S), off_heading, yaw),
        ):
            sign = np.sign(stick)
            past, by_estimate = overshoot(way * sign), overshoot(off[STOPPING:] * -sign)
            found.append(ReleaseResult(axis, t, horizontal, past, by_estimate))
    return found


def overshoot(way: Floats) -> float:
    """From the furthest point to where it settles, the mean of the last second."""
    return float(way.max()) - float(way[-100:].mean())
