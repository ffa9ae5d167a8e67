"""Nonlinear least squares with unknowns common to all windows and others of each window alone.

Gauss-Newton with Levenberg's damping. A window's own unknowns are eliminated by a QR factorisation,
so that what is left of its residual depends on the common ones only (variable projection; Golub and
Pereyra 2003, doi 10.1088/0266-5611/19/2/201).

Residuals are rarely white: the model is simple and water moves. So the covariance is estimated
twice, as for white noise, and from the sums of the scores over blocks of time that are longer than
the residuals' memory (the cluster-robust or sandwich estimator; Liang and Zeger 1986, doi
10.1093/biomet/73.1.13). The larger deviation counts.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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
