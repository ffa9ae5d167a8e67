"""What a release is judged by, from the true motion.

The simulator tells its depth in steps of 10 mm but its speed without steps, so what is travelled
is the integral of the speed.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
AFTER_S = 7.5  # [s] after a release that belong to it
RESTS_S = 3.0  # [s] at the end of them: at rest
BEFORE_S = 0.3  # [s] before it, over which the speed is taken
NEAR = 0.001  # [m] of the resting depth: it has been there


class TrueMotion(NamedTuple):
    """As the simulator tells it."""

    t: Floats  # [s] rises
    depth: Floats  # [m] in steps of 10 mm
    speed: Floats  # [m/s] down
    north: Floats  # [m/s]
    east: Floats  # [m/s]
    pitch: Floats  # [rad]
    heading: Floats  # [rad] without steps of a full turn


class JudgedRelease(NamedTuple):
    """Of depth [m, m/s], or of heading [rad, rad/s]."""

    t: Floats  # [s] since the stick was centred
    travelled: Floats  # since then, in the direction of motion
    sinking: bool  # until then
    speed: float  # at the release
    stopping: float  # greatest distance travelled
    bounce: float  # of it beyond where it comes to rest
    short: float  # farthest that it swings back from there, once it has been there
    rms: float  # at rest, about the mean
    doubt: float  # [m] most by which the integral differs from the depth in its steps


def judge(truth: TrueMotion, at: float, direction: float) -> JudgedRelease:
    """
    Args:
        at: [s] when the stick was centred.
        direction: 1 where it sank until then, -1 where it rose.

    Raises:
        ValueError: the truth does not cover the release.
    """
    found = _judged(truth.t - at, direction * integral(truth.t, truth.speed), direction)
    coarse = direction * (truth.depth - np.interp(at, truth.t, truth.depth))
    apart = np.abs(found.travelled - np.interp(found.t, truth.t - at, coarse))
    return found._replace(doubt=float(apart.max()))


def judge_turn(truth: TrueMotion, at: float, direction: float) -> JudgedRelease:
    """As `judge`, of the heading; `direction`: 1 where it turned to starboard."""
    return _judged(truth.t - at, direction * truth.heading, direction)


def judge_way(truth: TrueMotion, at: float) -> JudgedRelease:
    """As `judge`, of the way over the ground along the bow, as that was at the release."""
    bow = float(np.interp(at, truth.t, truth.heading))
    ahead = np.cos(bow) * truth.north + np.sin(bow) * truth.east
    return _judged(truth.t - at, integral(truth.t, ahead), 1.0)


def swayed(truth: TrueMotion, at: float) -> float:
    """[m] Farthest from the resting depth, of a drone that held it when another stick was let go.

    Raises:
        ValueError: the truth does not cover the release.
    """
    down, up = judge(truth, at, 1.0), judge(truth, at, -1.0)
    return max(down.bounce, up.bounce)


def _judged(t: Floats, way: Floats, direction: float) -> JudgedRelease:
    """
    Args:
        t: [s] since the release.
        way: in the direction of motion.
    """
    after, before = (t >= 0.0) & (t <= AFTER_S), (t >= -BEFORE_S) & (t < 0.0)
    if not before.any() or not (t > AFTER_S).any():
        raise ValueError("a release is not covered by what was recorded")
    travelled = (way - np.interp(0.0, t, way))[after]
    resting = travelled[t[after] >= AFTER_S - RESTS_S]
    stopping = float(travelled.max())
    there = int(np.argmax(travelled >= resting.mean() - NEAR))  # the first time
    return JudgedRelease(
        t=t[after],
        travelled=travelled,
        sinking=direction > 0.0,
        speed=float(-np.interp(-BEFORE_S, t, way) + np.interp(0.0, t, way)) / BEFORE_S,
        stopping=stopping,
        bounce=stopping - float(resting.mean()),
        short=float(resting.mean() - travelled[there:].min()),
        rms=float(resting.std()),
        doubt=0.0,
    )


def integral(t: Floats, rate: Floats) -> Floats:
    """By the trapezoidal rule, from the first time on."""
    steps = np.diff(t) * (rate[1:] + rate[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(steps)])
