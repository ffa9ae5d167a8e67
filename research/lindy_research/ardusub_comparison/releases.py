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


class TrueDepth(NamedTuple):
    """As the simulator tells it."""

    t: Floats  # [s] rises
    depth: Floats  # [m] in steps of 10 mm
    speed: Floats  # [m/s] down


class JudgedRelease(NamedTuple):
    t: Floats  # [s] since the stick was centred
    travelled: Floats  # [m] since then, in the direction of motion
    sinking: bool  # until then
    speed: float  # [m/s] at the release
    stopping: float  # [m] greatest distance travelled
    bounce: float  # [m] of it beyond the depth at which it comes to rest
    short: float  # [m] farthest that it swings back from there, once it has been there
    rms: float  # [m] at rest, about the mean
    doubt: float  # [m] most by which the integral differs from the depth in its steps


def judge(truth: TrueDepth, at: float, direction: float) -> JudgedRelease:
    """
    Args:
        at: [s] when the stick was centred.
        direction: 1 where it sank until then, -1 where it rose.

    Raises:
        ValueError: the truth does not cover the release.
    """
    t = truth.t - at
    after, before = (t >= 0.0) & (t <= AFTER_S), (t >= -BEFORE_S) & (t < 0.0)
    if not before.any() or not (t > AFTER_S).any():
        raise ValueError(f"the release at {at:.1f} s is not covered by what was recorded")
    travelled = _integral(t, direction * truth.speed)
    travelled = (travelled - np.interp(0.0, t, travelled))[after]
    coarse = direction * (truth.depth - np.interp(0.0, t, truth.depth))[after]
    resting = travelled[t[after] >= AFTER_S - RESTS_S]
    stopping = float(travelled.max())
    there = int(np.argmax(travelled >= resting.mean() - NEAR))  # the first time
    return JudgedRelease(
        t=t[after],
        travelled=travelled,
        sinking=direction > 0.0,
        speed=float(np.mean(direction * truth.speed[before])),
        stopping=stopping,
        bounce=stopping - float(resting.mean()),
        short=float(resting.mean() - travelled[there:].min()),
        rms=float(resting.std()),
        doubt=float(np.abs(travelled - coarse).max()),
    )


def _integral(t: Floats, rate: Floats) -> Floats:
    """By the trapezoidal rule, from the first time on."""
    steps = np.diff(t) * (rate[1:] + rate[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(steps)])
