"""From numbers near the right ones to the least sum of squares.

The beginning is linear regression at many lags. The momentum of an axis is what its forces add up
to. Where its velocity is known from the sensors, m v = ∫F dt − d ∫v dt − q ∫|v|v dt is linear in
everything but the lag, so that its least squares have one minimum; the lag is the best of a scan.
The motion of the other axes is left out, which makes it a guess and no more (equation error; Ljung
1999, §7.2). From there Gauss-Newton goes on, with Levenberg's damping.
"""

from math import log
from typing import NamedTuple

import numpy as np

from services.marine.hydrodynamics import system_inertia
from services.marine.vehicle import GRAVITY
from services.runtime.config.errors import LindyError
from tools.identify.dive_data import FitInput, Windows, only, times, wrench_over
from tools.identify.equations import (
    CHANNELS,
    OWN,
    Linearised,
    Point,
    Weights,
    damped_step,
    linearised,
    own_step,
    predicted,
)
from tools.identify.motion_model import (
    AXES,
    BUOYANCY,
    COUNT,
    LAG,
    ROWS,
    Beginning,
    Floats,
    indices_of,
    inertia_of,
    linear_of,
    quadratic_of,
)

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


# [m/s, rad/s, rad] of the estimate at a window's begin; the tilt's is the accelerometers' bias.
BEGIN_STD = np.array([0.15, 0.15, 0.1, 0.05, 0.03, 0.03])
FOLLOWED_STD = 0.01  # [m/s] of surge and sway at the end of the window before
# [-] of these deviations, at first: wrong drag could else be explained by surge and sway, of which
# the wake's lift makes drag whatever their signs.
COARSE = 0.05
FIRST_STD = np.array([0.03, 0.03, 0.03, 0.003, 0.05])  # [m/s², rad/s, m] before residuals are known
LEAST_STD = 1e-8  # [m/s², rad/s, m]
UNTOLD = 1e-4  # [-] 1/σ of what is fitted, so that the equations are never singular
FIXED = 1e6  # [-] 1/σ of what is held
MOST_STEPS = 15
SMALL_DAMPING = 1e-2  # [-] a step damped more says nothing about the gain to be had
ROUGH, FINE = 1.0, 0.02  # [-] gain of the sum of squares, in units of the noise, that ends it
NOT_EXPLAINED = 3.0  # [-] times the median residual of the windows: something else pushed there


class Search(NamedTuple):
    """Where it is, of which data."""

    taken: FitInput
    start: Beginning
    weights: Weights
    at: Linearised


def began(taken: FitInput, start: Beginning, axes: tuple[str, ...], lag: bool, x: Floats) -> Search:
    """At a first guess (COUNT,), with the velocities at the begin as estimated."""
    inverse = 1.0 / start.prior**2
    inverse[free(axes, lag)] = UNTOLD**2
    if not taken.fits_lag:
        inverse[LAG] = FIXED**2
    estimate: Floats = np.pad(taken.windows.begin.astype(float), ((0, 0), (0, 2)))
    std = np.tile(BEGIN_STD, (len(estimate), 1))
    weights = Weights(FIRST_STD, start.vector, inverse, estimate, std)
    point = Point(x, estimate)
    base = predicted(taken, start, point)
    return Search(taken, start, weights, linearised(taken, point, base, weights))


def free(axes: tuple[str, ...], lag: bool) -> list[int]:
    """Parameters that are fitted."""
    return [index for axis in axes for index in indices_of(axis)] + ([LAG] if lag else [])


def searched(here: Search, fitted: list[int], adrift: tuple[float, float] = (0.0, 0.0)) -> Search:
    """At the least sum of squares near by. First only what is fitted moves, the rest is as
    estimated and as in the file; then everything. The sensors' weights come from the residuals.

    Args:
        adrift: [m/s] surge and sway to begin with where no window tells them.
    """
    whole = here.weights
    inverse = whole.inverse.copy()
    inverse[np.setdiff1d(np.arange(COUNT), fitted)] /= COARSE**2
    pinned = whole.begin_std * np.array([COARSE, COARSE, 1.0, 1.0, 1.0, 1.0])
    here = descended(weighed(here, whole._replace(inverse=inverse, begin_std=pinned)), ROUGH)
    here = descended(_followed(here, whole, adrift), ROUGH)
    here = _explained(here)
    here = descended(_followed(here, by_residuals(here)), ROUGH)
    return descended(weighed(here, by_residuals(here)), FINE)


def descended(here: Search, enough: float) -> Search:
    """At the least sum of squares by these weights.

    Raises:
        LindyError: no model gives this dive a finite motion.
    """
    if not np.isfinite(here.at.normal.cost):
        raise LindyError("no inertia and drag explain how it moved")
    damping = 1e-5
    for _ in range(MOST_STEPS):
        now = here.at
        step = np.clip(damped_step(now.normal, damping), -1.0, 1.0)
        share = 1.0 / (1.0 + damping)
        own = [share * own_step(window, step)[:OWN] for window in now.equations]
        begin = now.point.begin + np.array(own).reshape(-1, OWN)
        there = _moved(here, Point(now.point.x + step, begin))
        gain = now.normal.cost - there.at.normal.cost
        better = gain >= 0.0  # not if NaN
        here = there if better else here
        hoped = float(now.normal.score @ step)
        if damping <= SMALL_DAMPING and (abs(gain) <= enough or (not better and hoped <= enough)):
            break
        damping *= 0.1 if better else 10.0
    return here


def _followed(here: Search, whole: Weights, adrift: tuple[float, float] = (0.0, 0.0)) -> Search:
    """By these weights, and with surge and sway at the begin of a window as at the end of the one
    before, where one follows the other. The yaw rate alone tells little more than the product of
    the two (Munk's moment), so that a descent would not find from wrong signs to the right ones."""
    w = here.taken.windows
    ends = here.at.predicted.velocity[0, :, -1, :2]
    later = 1 + np.flatnonzero(w.t[1:, 0] - w.t[:-1, -1] < 2 * w.period)
    begin, estimate = here.at.point.begin.copy(), whole.estimate.copy()
    std = whole.begin_std.copy()
    begin[:, :2] += adrift
    begin[later, :2] = estimate[later, :2] = ends[later - 1]
    std[later, :2] = FOLLOWED_STD
    weights = whole._replace(estimate=estimate, begin_std=std)
    return _moved(here._replace(weights=weights), Point(here.at.point.x, begin))


def weighed(here: Search, weights: Weights) -> Search:
    """With other weights, at the same place."""
    at = linearised(here.taken, here.at.point, here.at.predicted, weights)
    return here._replace(weights=weights, at=at)


def by_residuals(here: Search) -> Weights:
    """Each channel's noise as its residuals show."""
    noise = here.weights.noise.copy()
    for channel in range(CHANNELS):
        parts = [
            left.residual[channels == channel]
            for left, channels in zip(here.at.left, here.at.channels, strict=True)
        ]
        rms = float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
        noise[channel] = max(LEAST_STD, rms * noise[channel])
    return here.weights._replace(noise=noise)


def misfit(here: Search) -> float:
    """[-] Twice the negative logarithm of the likelihood, up to a constant: sums of squares are
    in units of each search's own noise."""
    noise = 2.0 * np.log(here.weights.noise)
    samples = [noise[channels[channels >= 0]].sum() for channels in here.at.channels]
    return here.at.normal.cost + float(np.sum(samples))


def _moved(here: Search, point: Point) -> Search:
    """At another point. One at which the motion has no bound ends in NaN, and is not taken."""
    with np.errstate(over="ignore", invalid="ignore"):
        base = predicted(here.taken, here.start, point)
        return here._replace(at=linearised(here.taken, point, base, here.weights))


def _explained(here: Search) -> Search:
    """Without the windows in which something else than the thrusters moved the vehicle."""
    sizes = np.array([np.sqrt(np.mean(left.residual**2)) for left in here.at.left])
    keep: list[int] = np.flatnonzero(sizes <= NOT_EXPLAINED * np.median(sizes)).tolist()
    if len(keep) == len(sizes):
        return here
    point = here.at.point._replace(begin=here.at.point.begin[keep])
    old = here.weights
    weights = old._replace(estimate=old.estimate[keep], begin_std=old.begin_std[keep])
    fewer = here._replace(taken=only(here.taken, keep), weights=weights)
    return descended(_moved(fewer, point), ROUGH)
