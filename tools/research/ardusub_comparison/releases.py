"""What a release is judged by, from the true depth."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
AFTER_S = 7.5  # [s] after a release that belong to it
RESTS_S = 3.0  # [s] at the end of them: at rest
BEFORE_S = 0.3  # [s] before it, over which the speed is taken


class TrueDepth(NamedTuple):
    """As the simulator knows it."""

    t: Floats  # [s] rises
    depth: Floats  # [m]
    speed: Floats  # [m/s] down


class JudgedRelease(NamedTuple):
    t: Floats  # [s] since the stick was centred
    travelled: Floats  # [m] since then, in the direction of motion
    sinking: bool  # until then
    speed: float  # [m/s] at the release
    stopping: float  # [m] greatest distance travelled
    bounce: float  # [m] of it beyond the depth at which it comes to rest
    rms: float  # [m] at rest, about the mean


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
    begin = float(np.interp(0.0, t, truth.depth))
    travelled = direction * (truth.depth[after] - begin)
    resting = travelled[t[after] >= AFTER_S - RESTS_S]
    stopping = float(travelled.max())
    return JudgedRelease(
        t=t[after],
        travelled=travelled,
        sinking=direction > 0.0,
        speed=float(np.mean(direction * truth.speed[before])),
        stopping=stopping,
        bounce=stopping - float(resting.mean()),
        rms=float(resting.std()),
    )
