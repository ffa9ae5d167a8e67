"""Nonlinear least squares with unknowns common to all windows and others of each window alone.

Of each window its own unknowns are: the velocities and the error of the tilt at its begin, the slow
wander of that tilt, offset and drift of the accelerometers, offset of the yaw gyroscope and of the
depth. They are eliminated by a QR factorisation, so that what is left of its residual depends on
the common ones only (variable projection; Golub and Pereyra 2003, doi 10.1088/0266-5611/19/2/201).

Residuals are rarely white: the model is simple and water moves. So the covariance is estimated
twice, as for white noise, and from the sums of the scores over blocks of time that are longer than
the residuals' memory (the cluster-robust or sandwich estimator; Liang and Zeger 1986, doi
10.1093/biomet/73.1.13). The larger deviation counts.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.marine.vehicle import GRAVITY
from tools.identify.dive_data import FitInput, Windows, columns_at, times, wrench_over
from tools.identify.motion_model import (
    COUNT,
    LAG,
    Beginning,
    Floats,
    Measured,
    Predicted,
    coefficients,
    predict,
    vehicle_of,
)

STEP = 1e-4  # [-], [m/s], [rad] of a difference quotient
OWN = 6  # unknowns of a window that change its motion: velocities and tilt at its begin
COLUMNS = 1 + COUNT + OWN  # here, and a step in each


class Point(NamedTuple):
    """Where the search is."""

    x: Floats  # (COUNT,) see motion_model.py
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


class WindowEquations(NamedTuple):
    """One window, linearised, in units of the noise: residual − common·dx − own·dy."""

    residual: Floats  # (n,)
    common: Floats  # (n, p)
    own: Floats  # (n, k) full rank
    block: NDArray[np.int64]  # (n,) number of the block of time, from 0


class Eliminated(NamedTuple):
    residual: Floats
    common: Floats
    block: NDArray[np.int64]


class NormalEquations(NamedTuple):
    information: Floats  # (p, p)
    score: Floats  # (p,)
    cost: float  # sum of squares


def eliminate(window: WindowEquations) -> Eliminated:
    """What no choice of the window's own unknowns explains."""
    q, _ = np.linalg.qr(window.own)
    both = np.column_stack([window.residual, window.common])
    left = both - q @ (q.T @ both)
    return Eliminated(left[:, 0], left[:, 1:], window.block)


def own_step(window: WindowEquations, common_step: Floats) -> Floats:
    """(k,) The best step of the window's own unknowns beside this common step (p,)."""
    wanted = window.residual - window.common @ common_step
    step: Floats = np.linalg.lstsq(window.own, wanted, rcond=None)[0].astype(np.float64)
    return step


def normal_equations(
    windows: Sequence[Eliminated], pull: Floats, inverse: Floats
) -> NormalEquations:
    """
    Args:
        pull: (p,) prior value minus present value.
        inverse: (p,) 1/σ² of the prior; 0: none.
    """
    information = np.diag(inverse).astype(float)
    score, cost = inverse * pull, float(np.sum(inverse * pull**2))
    for window in windows:
        information += window.common.T @ window.common
        score += window.common.T @ window.residual
        cost += float(window.residual @ window.residual)
    return NormalEquations(information, score, cost)


def damped_step(equations: NormalEquations, damping: float) -> Floats:
    scale = np.sqrt(np.diag(equations.information))
    scale[scale == 0.0] = 1.0
    balanced = equations.information / np.outer(scale, scale)
    step = np.linalg.solve(balanced + damping * np.eye(len(scale)), equations.score / scale)
    return step / scale


def covariance(windows: Sequence[Eliminated], inverse: Floats) -> tuple[Floats, Floats]:
    """(p, p) as for white noise, and (p,) by how much each deviation is larger because residuals
    are not white, at least 1."""
    zero = np.zeros(len(inverse))
    information = normal_equations(windows, zero, inverse).information
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    white = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    scores = np.array(
        [
            window.common[window.block == number].T @ window.residual[window.block == number]
            for window in windows
            for number in range(int(window.block.max()) + 1)
        ]
    )
    blocks = len(scores)
    spread = scores.T @ scores * blocks / max(1, blocks - len(inverse))
    robust = np.diag(white @ (spread + np.diag(inverse)) @ white)
    return white, np.sqrt(np.maximum(1.0, robust / np.diag(white)))


YAW, DEPTH, CHANNELS = 3, 4, 5  # channels: three forces, yaw rate, depth
KNOT_S = 2.0  # [s] between changes of the tilt by the gyroscopes' noise
BLOCK_S = 1.0  # [s] longer than the residuals' memory
Channels = NDArray[np.int64]


class Weights(NamedTuple):
    """What is known besides the data, and how well the data are."""

    noise: Floats  # (CHANNELS,) [m/s² × 3, rad/s, m] std of a residual
    prior: Floats  # (COUNT,)
    inverse: Floats  # (COUNT,) 1/σ² of the prior
    estimate: Floats  # (windows, OWN) of the begin
    begin_std: Floats  # (windows, OWN)


class Linearised(NamedTuple):
    point: Point
    predicted: Predicted
    equations: list[WindowEquations]
    channels: list[Channels]  # per window (rows,) the channel of each; -1: what is known besides
    left: list[Eliminated]
    normal: NormalEquations


def linearised(taken: FitInput, point: Point, base: Predicted, weights: Weights) -> Linearised:
    """Residuals of this prediction, and what is left when each window's own unknowns are best."""
    equations, channels = list[WindowEquations](), list[Channels]()
    for number in range(len(taken.windows.t)):
        window, of = _window(taken, point, base, weights, number)
        equations.append(window)
        channels.append(of)
    left = [eliminate(window) for window in equations]
    normal = normal_equations(left, weights.prior - point.x, weights.inverse)
    return Linearised(point, base, equations, channels, left, normal)


def _window(
    taken: FitInput, point: Point, base: Predicted, weights: Weights, number: int
) -> tuple[WindowEquations, Channels]:
    """The equations of one window, and the channel of each."""
    since = times(base.velocity.shape[2], taken.windows.period)
    parts = [_channel(taken.windows, base, weights, number, k, since) for k in range(CHANNELS)]
    tilts = [_tilts(taken.windows, base, weights, number, k, parts[k][2]) for k in range(CHANNELS)]
    slope = np.concatenate([part[1] for part in parts])  # (rows, COUNT + OWN)
    offsets = _block_diagonal([_offsets(k, part[2]) for k, part in enumerate(parts)])

    knots = tilts[0].shape[1]
    wander = np.full(knots, max(taken.wander, 1e-7) * np.sqrt(KNOT_S))
    known = OWN + knots
    begin_std = weights.begin_std[number]
    estimate: Floats = (weights.estimate[number] - point.begin[number]) / begin_std
    residual = np.concatenate([*[part[0] for part in parts], estimate, np.zeros(knots)])
    motion = np.vstack(
        [
            np.hstack([slope[:, COUNT:], np.vstack(tilts)]),
            np.diag(1.0 / np.concatenate([begin_std, wander])),
        ]
    )
    common = np.vstack([slope[:, :COUNT], np.zeros((known, COUNT))])
    offsets = np.vstack([offsets, np.zeros((known, offsets.shape[1]))])
    block = np.concatenate([(part[2] / BLOCK_S).astype(np.int64) for part in parts])
    block = np.concatenate([block, np.zeros(known, dtype=np.int64)])
    channels = np.repeat(np.arange(CHANNELS, dtype=np.int64), [len(part[0]) for part in parts])
    return (
        WindowEquations(residual, common, np.hstack([motion, offsets]), block),
        np.concatenate([channels, np.full(known, -1)]),
    )


def _channel(
    w: Windows, base: Predicted, weights: Weights, number: int, channel: int, since: Floats
) -> tuple[Floats, Floats, Floats]:
    """Residual (n,), slope (n, COUNT + OWN) by the parameters and by velocities and tilt at the
    begin, and the times [s]; in units of the noise."""
    n = len(since)
    if channel == DEPTH:
        at = np.clip(w.depth_t[number] / w.period, 0, n - 1.001)
        index, share = at.astype(int), at - at.astype(int)
        depth = base.depth[:, number]
        expected = depth[:, index] * (1 - share) + depth[:, index + 1] * share
        measured, when = w.depth[number], w.depth_t[number]
    elif channel == YAW:
        expected, measured = base.velocity[:, number, :, 3], w.rates[number, :n, 2]
        when = since
    else:
        expected = base.force[:, number, :, channel]
        measured, when = w.force[number, :n, channel], since
    std = weights.noise[channel]
    slope = (expected[1:] - expected[0]) / STEP
    return (measured - expected[0]) / std, slope.T / std, when


def _tilts(
    w: Windows, base: Predicted, weights: Weights, number: int, channel: int, when: Floats
) -> Floats:
    """(n, 2 knots) By later changes of the tilt; in units of the noise. What little they change in
    the motion is left out."""
    velocity = base.velocity[0, number, :, :3]
    n = len(velocity)
    since = times(n, w.period)
    knots = np.arange(KNOT_S, since[-1], KNOT_S)
    later = since[:, None] >= knots  # (n, knots)
    tilted = (w.tilted[number, :n, :, None, :] * later[:, None, :, None]).reshape(n, 3, -1)
    if channel == YAW:
        return np.zeros((n, tilted.shape[2]))
    if channel < YAW:
        return -GRAVITY * tilted[:, channel] / weights.noise[channel]
    rate = np.einsum("ni,nik->nk", velocity, tilted)
    depth = w.period * np.cumsum(rate, axis=0)
    return columns_at(when, since, depth) / weights.noise[DEPTH]


def _offsets(channel: int, when: Floats) -> Floats:
    """Offset, and of the accelerometers drift."""
    one = np.ones(len(when))
    return np.column_stack([one, when] if channel < YAW else [one])


def _block_diagonal(parts: list[Floats]) -> Floats:
    rows, columns = sum(len(part) for part in parts), sum(part.shape[1] for part in parts)
    found, row, column = np.zeros((rows, columns)), 0, 0
    for part in parts:
        found[row : row + len(part), column : column + part.shape[1]] = part
        row, column = row + len(part), column + part.shape[1]
    return found
