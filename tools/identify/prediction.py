"""The prediction of every window from its begin, here and a step away in each unknown."""

from typing import NamedTuple

import numpy as np

from tools.identify.fit_input import FitInput, wrench_over
from tools.identify.motion_model import Measured, Predicted, coefficients, predict
from tools.identify.parameters import COUNT, LAG, Beginning, vehicle_of
from tools.identify.thrust import Floats

STEP = 1e-4  # [-], [m/s], [rad] of a difference quotient
OWN = 6  # unknowns of a window that change its motion: velocities and tilt at its begin
COLUMNS = 1 + COUNT + OWN  # here, and a step in each


class Point(NamedTuple):
    """Where the search is."""

    x: Floats  # (COUNT,) see parameters.py
    begin: Floats  # (windows, OWN) [m/s, rad/s] velocities, [rad] tilt beyond the estimate


def predicted(taken: FitInput, start: Beginning, point: Point) -> Predicted:
    """Columns: here, a step in each parameter, in each velocity and tilt at the begin."""
    points = np.tile(point.x, (COLUMNS, 1))
    points[1 : COUNT + 1] += STEP * np.eye(COUNT)
    begin = np.tile(point.begin, (COLUMNS, 1, 1))
    for number in range(OWN):
        begin[COUNT + 1 + number, :, number] += STEP
    vehicles = [vehicle_of(start, each) for each in points]
    w = taken.windows
    down = w.down + np.einsum("wnik,cwk->cwni", w.tilted, begin[..., 4:])
    measured = Measured(w.period, *_wrench(taken, float(point.x[LAG])), w.rates[..., :2], down)
    return predict(coefficients(vehicles, taken.wake_share), begin[..., :4], measured)


def _wrench(taken: FitInput, lag: float) -> tuple[Floats, Floats]:
    """(columns or 1, windows, …, 4) Only the lag's column differs.

    Args:
        lag: ln [s]
    """
    if taken.thrust is None or not taken.fits_lag:
        return taken.wrench[None], taken.mean[None]
    here = wrench_over(taken.thrust, taken.windows, float(np.exp(lag)))
    later = wrench_over(taken.thrust, taken.windows, float(np.exp(lag + STEP)))
    found, means = (np.repeat(part[None], COLUMNS, axis=0) for part in here)
    found[1 + LAG], means[1 + LAG] = later
    return found, means
