"""The residuals of every window, with their derivatives.

Of each window its own unknowns are: the velocities and the error of the tilt at its begin, the slow
wander of that tilt, offset and drift of the accelerometers, offset of the yaw gyroscope and of the
depth.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.marine.vehicle import GRAVITY
from tools.identify.dive_data import Windows, columns_at, times
from tools.identify.fit_input import FitInput
from tools.identify.least_squares import (
    Eliminated,
    NormalEquations,
    WindowEquations,
    eliminate,
    normal_equations,
)
from tools.identify.motion_model import Predicted
from tools.identify.parameters import COUNT
from tools.identify.prediction import OWN, STEP, Point
from tools.identify.thrust import Floats

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
