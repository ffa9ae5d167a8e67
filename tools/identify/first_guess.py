"""Numbers near the right ones, from which the fit begins: linear regression at many lags.

The momentum of an axis is what its forces add up to. Where its velocity is known from the sensors,
m v = ∫F dt − d ∫v dt − q ∫|v|v dt is linear in everything but the lag, so that its least squares
have one minimum; the lag is the best of a scan. The motion of the other axes is left out, which
makes it a guess and no more (equation error; Ljung 1999, §7.2).
"""

from math import log
from typing import NamedTuple

import numpy as np

from services.marine.hydrodynamics import system_inertia
from services.marine.vehicle import GRAVITY
from tools.identify.dive_data import Windows, times
from tools.identify.fit_input import FitInput, wrench_over
from tools.identify.motion_model import ROWS
from tools.identify.parameters import (
    AXES,
    BUOYANCY,
    LAG,
    Beginning,
    inertia_of,
    linear_of,
    quadratic_of,
)
from tools.identify.thrust import Floats

LAGS = np.geomspace(0.02, 0.5, 30)  # [s]
EVERY = 5  # a sample of so many
UNLIKE = 4.0  # [-] an inertia by more than this factor from the file's is no guess
UNKNOWN_BEGIN = {"surge": 2, "sway": 2, "heave": 0, "yaw": 0}  # polynomial a window's velocity
# is known up to: the accelerometers' offset, through tilt, is a drift of surge and sway


class _Regression(NamedTuple):
    of: Floats  # (4,) 1/m, −d/m, −q/m, −buoyancy/m
    misfit: float  # n ln of the sum of squares


def first_guess(taken: FitInput, start: Beginning, axes: tuple[str, ...], lag: bool) -> Floats:
    """(COUNT,) The file's numbers, but for these axes and, if it is to be fitted, the lag."""
    w = taken.windows
    speeds = {axis: _speed(w, AXES.index(axis)) for axis in axes}
    lags = [float(each) for each in LAGS] if lag else [None]
    tried: list[dict[str, _Regression]] = []
    for each in lags:
        wrench = _wrench(taken, each)
        tried.append({axis: _regression(w, wrench, speeds[axis], axis) for axis in axes})
    best = min(range(len(lags)), key=lambda n: sum(r.misfit for r in tried[n].values()))
    x = start.vector
    if (chosen := lags[best]) is not None:
        x[LAG] = log(chosen)
    for axis, found in tried[best].items():
        _take(x, start, axis, found.of, float(np.quantile(np.abs(speeds[axis]), 0.95)))
    return x


def _wrench(taken: FitInput, lag: float | None) -> Floats:
    """(windows, n, 4) [N, N m]"""
    if taken.thrust is None or lag is None:
        return taken.wrench
    return wrench_over(taken.thrust, taken.windows, lag)[0]


def _speed(w: Windows, axis: int) -> Floats:
    """(windows, n) [m/s, rad/s] As the sensors tell; surge and sway but for a slow drift."""
    if AXES[axis] == "yaw":
        return w.rates[..., 2]
    gained = _integral(w.force[..., axis] + GRAVITY * w.down[..., axis], w.period)
    since = times(gained.shape[1], w.period)
    found = np.empty_like(gained)
    for number, row in enumerate(gained):
        if AXES[axis] == "heave":
            sunk = _integral(row, w.period)
            left = w.depth[number] - np.interp(w.depth_t[number], since, sunk)
            when = w.depth_t[number]
            _, begin, drift = _polynomial(left, when, 2)
            found[number] = row + begin + 2 * drift * since
        else:
            found[number] = row - np.vander(since, 2, True) @ _polynomial(row, since, 1)
    return found


def _integral(values: Floats, period: float) -> Floats:
    """(…, n) From the first, by trapezoids."""
    found = np.zeros_like(values)
    np.cumsum((values[..., 1:] + values[..., :-1]) * (period / 2), axis=-1, out=found[..., 1:])
    return found


def _polynomial(values: Floats, t: Floats, order: int) -> Floats:
    """(order + 1,) Coefficients, the constant first."""
    powers = np.vander(t, order + 1, increasing=True)
    return np.linalg.lstsq(powers, values, rcond=None)[0].astype(np.float64)


def _regression(w: Windows, wrench: Floats, speed: Floats, axis: str) -> _Regression:
    down = w.down[..., 2] if axis == "heave" else np.zeros_like(speed)
    forces = np.stack([wrench[..., AXES.index(axis)], speed, np.abs(speed) * speed, down], axis=-1)
    momenta = np.moveaxis(_integral(np.moveaxis(forces, 2, 0), w.period), 0, 2)[:, ::EVERY]
    powers = np.vander(times(momenta.shape[1], EVERY * w.period), UNKNOWN_BEGIN[axis] + 1)
    q, _ = np.linalg.qr(powers)
    both = np.concatenate([momenta, speed[:, ::EVERY, None]], axis=-1)
    both = (both - q @ (q.T @ both)).reshape(-1, 5)
    found = np.linalg.lstsq(both[:, :4], both[:, 4], rcond=None)[0].astype(np.float64)
    left = both[:, 4] - both[:, :4] @ found
    return _Regression(found, len(left) * log(float(left @ left) + 1e-300))


def _take(x: Floats, start: Beginning, axis: str, of: Floats, speed: float) -> None:
    """Put it into x, if it makes sense. A negative coefficient of drag: both as in the file, scaled
    to the drag at this speed."""
    number = AXES.index(axis)
    inertia = system_inertia(start.vehicle)[ROWS[number]]
    if not inertia / UNLIKE < 1.0 / max(float(of[0]), 1e-9) < inertia * UNLIKE:
        return
    mass = 1.0 / float(of[0])
    linear, quadratic, buoyancy = (-mass * float(value) for value in of[1:])
    row = ROWS[number]
    own = start.vehicle.linear_damping[row], start.vehicle.quadratic_damping[row]
    if min(linear, quadratic) < 0.0:
        drag = linear * speed + quadratic * speed**2
        share = max(0.1, drag / max(1e-9, own[0] * speed + own[1] * speed**2))
        linear, quadratic = share * own[0], share * own[1]
    x[inertia_of(number)] = log(mass)
    x[linear_of(number)] = linear / start.linear[number]
    x[quadratic_of(number)] = quadratic / start.quadratic[number]
    if axis == "heave":
        x[BUOYANCY] = buoyancy
