"""The fit: the vehicle whose open-loop motion, from the recorded commands, is nearest to what the
sensors measured.

Output error (Ljung 1999, §7.3): every window is predicted from its begin by thrust alone, and
compared with the specific force, the yaw rate and the depth. What belongs to a window alone is
eliminated (equations.py). A linear regression says where to begin, and Gauss-Newton goes on from
there (search.py); the deviations take the residuals as they are, white or not.
"""

from typing import NamedTuple

import numpy as np

from tools.identify.dive_data import FitInput
from tools.identify.equations import Linearised, Point, covariance
from tools.identify.motion_model import (
    AXES,
    COUNT,
    LAG,
    Beginning,
    Floats,
    inertia_of,
    linear_of,
    quadratic_of,
)
from tools.identify.search import (
    FINE,
    FIXED,
    Search,
    began,
    descended,
    first_guess,
    free,
    misfit,
    searched,
    weighed,
)

MOST_INERTIA_STD = 0.1  # [-] an axis that the data tell less of is not fitted
MOST_DRAG_STD = 0.3  # [-] of the drag at the typical speed
MOST_LAG_STD = 0.5  # [-]
NOT_MOVED = np.inf, np.inf  # in place of deviations
LEAST_SPEED = 0.15  # [m/s, rad/s] typical of an axis that was moved on purpose

Deviations = tuple[float, float]  # [-] of inertia and of drag


def white_covariance(here: Search) -> Floats:
    """(COUNT, COUNT) If residuals were white."""
    return covariance(here.at.left, here.weights.inverse)[0]


def honest_covariance(here: Search) -> tuple[Floats, Floats]:
    """(COUNT, COUNT) with the residuals as they are, and (COUNT,) by how much each deviation is
    larger for that."""
    white, inflation = covariance(here.at.left, here.weights.inverse)
    return white * np.outer(inflation, inflation), inflation


def weak(here: Search, cov: Floats, axes: tuple[str, ...], lag: bool) -> dict[str, Deviations]:
    """Of these axes, and the lag, those that the data tell too little of."""
    found: dict[str, Deviations] = {}
    speed = typical_speed(here.at)
    for name in axes:
        axis = AXES.index(name)
        inertia = float(np.sqrt(cov[inertia_of(axis), inertia_of(axis)]))
        value, std = drag_at(here.start, here.at.point.x, cov, axis, float(speed[axis]))
        drag = std / value if value > 0.0 else np.inf
        if not speed[axis] >= LEAST_SPEED:
            found[name] = NOT_MOVED
        elif not (inertia <= MOST_INERTIA_STD and drag <= MOST_DRAG_STD):
            found[name] = inertia, drag
    if lag and not np.sqrt(cov[LAG, LAG]) <= MOST_LAG_STD:
        found["lag"] = float(np.sqrt(cov[LAG, LAG])), 0.0
    return found


def typical_speed(at: Linearised) -> Floats:
    """(4,) [m/s, rad/s] Exceeded in a twentieth of the time."""
    moving = np.abs(np.asarray(at.predicted.velocity[0], dtype=np.float64)).reshape(-1, 4)
    moving.sort(axis=0)
    return moving[int(0.95 * len(moving))]


def drag_at(
    start: Beginning, x: Floats, cov: Floats, axis: int, speed: float
) -> tuple[float, float]:
    """[N, N m] Drag of an axis at a speed, and its deviation."""
    by = np.zeros(COUNT)
    by[linear_of(axis)] = start.linear[axis] * speed
    by[quadratic_of(axis)] = start.quadratic[axis] * speed**2
    return float(by @ x), float(np.sqrt(max(0.0, by @ cov @ by)))


WHITE = 1.5  # [-] deviations enlarged by less: the residuals are white
ADRIFT = (0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.0, -0.1)  # [m/s] surge and sway


class Fit(NamedTuple):
    x: Floats  # (COUNT,) see motion_model.py
    covariance: Floats  # (COUNT, COUNT)
    axes: tuple[str, ...]  # that are fitted
    lag: bool  # is fitted
    speed: Floats  # (4,) [m/s, rad/s] typical of the dive
    inflation: Floats  # (COUNT,) of the deviations, because residuals are not white
    unexplained: int  # windows left out
    refused: dict[str, Deviations]  # the std that inertia and drag of these axes would have


def fit(taken: FitInput, start: Beginning, axes: tuple[str, ...] = AXES) -> Fit:
    """The axes of these that the data tell enough of; there may be none."""
    refused: dict[str, Deviations] = {}
    lag = taken.fits_lag
    while True:
        there = here = began(taken, start, axes, lag, start.vector)
        untold = weak(here, white_covariance(here), axes, lag)  # costs one prediction
        if not untold:
            guess = first_guess(taken, start, axes, lag)
            there = began(taken, start, axes, lag, guess)
            here = searched(there, free(axes, lag))
            untold = weak(here, honest_covariance(here)[0], axes, lag)
        if not untold:
            here = _best(there, here, free(axes, lag))
            return _result(taken, here, axes, lag, refused)
        refused |= untold
        lag = lag and "lag" not in untold
        axes = tuple(axis for axis in axes if axis not in untold)
        if not axes:
            return _result(taken, here, (), False, refused)


def _best(there: Search, found: Search, fitted: list[int]) -> Search:
    """What was found from there; where its residuals are not white, the best of that and of
    searches with the vehicle adrift each way at first."""
    if honest_covariance(found)[1].max() < WHITE:
        return found
    others = [searched(there, fitted, adrift) for adrift in ADRIFT]
    # What explains more windows is better; then what explains them better.
    return min([found, *others], key=lambda each: (-len(each.taken.windows.t), misfit(each)))


def _result(
    taken: FitInput,
    here: Search,
    axes: tuple[str, ...],
    lag: bool,
    refused: dict[str, Deviations],
) -> Fit:
    """With drag held at zero where it came out negative."""
    cov, inflation = honest_covariance(here)
    unexplained = len(taken.windows.t) - len(here.taken.windows.t)
    here = _driving_never(here) if free(axes, lag) else here
    return Fit(
        here.at.point.x, cov, axes, lag, typical_speed(here.at), inflation, unexplained, refused
    )


def _driving_never(here: Search) -> Search:
    """A coefficient of drag that comes out negative is held at zero. The deviations stay those of
    the fit without this knowledge."""
    x = here.at.point.x
    drags = [of(axis) for axis in range(len(AXES)) for of in (linear_of, quadratic_of)]
    negative = [index for index in drags if x[index] < 0.0]
    if not negative:
        return here
    prior, inverse = here.weights.prior.copy(), here.weights.inverse.copy()
    prior[negative], inverse[negative] = 0.0, FIXED**2
    here = descended(weighed(here, here.weights._replace(prior=prior, inverse=inverse)), FINE)
    x = here.at.point.x.copy()
    x[negative] = 0.0
    at = here.at._replace(point=Point(x, here.at.point.begin))
    return here._replace(at=at)
