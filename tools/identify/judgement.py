"""What the data tell of each axis, and how well."""

import numpy as np

from tools.identify.least_squares import covariance
from tools.identify.linearised import Linearised
from tools.identify.parameters import (
    AXES,
    COUNT,
    LAG,
    Beginning,
    inertia_of,
    linear_of,
    quadratic_of,
)
from tools.identify.search import Search
from tools.identify.thrust import Floats

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


def condition(white: Floats, fitted: list[int]) -> float:
    """[-] Of the information about what is fitted, each scaled to 1."""
    information = np.linalg.inv(white[np.ix_(fitted, fitted)])
    scale = np.sqrt(np.diag(information))
    return float(np.linalg.cond(information / np.outer(scale, scale)))
