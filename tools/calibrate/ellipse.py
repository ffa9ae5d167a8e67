"""The ellipse through points: centre, shape, and how well they are known.

Least squares by Gauss-Newton on the distance in units of the radius, |A (p - c)| = 1 with a
symmetric A (Gander, Golub and Strebel 1994, *Least-squares fitting of circles and ellipses*, BIT
34(4), for the choice of a geometric distance).
"""

from typing import NamedTuple

import numpy as np

from tools.recordings.allan import Floats

ROUNDS = 50
STEP = 1e-12  # [-] smaller steps, in units of the radius, end the iteration
MOST_ALIKE = 0.9  # [-] correlation from one residual to the next that is believed


class Ellipse(NamedTuple):
    """Maps its points p to a circle: |shape (p - centre)| = radius."""

    centre: Floats  # shape (2,), unit of the points
    shape: Floats  # shape (2, 2), symmetric, determinant 1
    radius: float
    rms: float  # of the distance, in the unit of the points
    centre_covariance: Floats  # shape (2, 2)
    shape_std: float  # [-] largest of the entries'


def through(points: Floats) -> Ellipse:
    """
    Args:
        points: shape (n, 2), at least six.

    Raises:
        ValueError: no ellipse goes through them.
    """
    middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
    size = float(np.ptp(points, axis=0).max()) / 2.0
    if size <= 0.0:
        raise ValueError("all points are one")
    p = (points - middle) / size  # of the order of one, so that a step is small or not
    x: Floats = np.array([0.0, 0.0, 1.0, 0.0, 1.0])  # centre, then A's 11, 12 and 22
    for _ in range(ROUNDS):
        residual, slope = _distance(p, x)
        if np.linalg.cond(slope) > 1e8:
            raise ValueError("they are on no ellipse")
        step: Floats = np.linalg.lstsq(slope, -residual, rcond=None)[0].astype(np.float64)
        x = x + step
        if max(np.abs(step)) < STEP:
            break
    residual, slope = _distance(p, x)
    a, b, c = x[2:].tolist()
    if not np.all(np.isfinite(x)) or a <= 0.0 or a * c - b * b <= 0.0:
        raise ValueError("they are on no ellipse")
    inverse: Floats = np.linalg.inv(slope.T @ slope).astype(np.float64)
    covariance = _variance(residual) * inverse
    round_ = (a * c - b * b) ** -0.5
    turn = np.array([_unit(x[2:] + 1e-6 * e) - _unit(x[2:] - 1e-6 * e) for e in np.eye(3)]) / 2e-6
    stds = np.sqrt(np.diag(turn.T @ covariance[2:, 2:] @ turn))
    return Ellipse(
        centre=middle + size * x[:2],
        shape=np.array([[a, b], [b, c]]) * round_,
        radius=size * round_,
        rms=size * round_ * float(np.sqrt(np.mean(residual**2))),
        centre_covariance=size * size * covariance[:2, :2],
        shape_std=float(max(stds)),
    )


def _distance(p: Floats, x: Floats) -> tuple[Floats, Floats]:
    """|A (p - c)| - 1, shape (n,), and its slopes, shape (n, 5)."""
    a, b, c = x[2:].tolist()
    off, A = p - x[:2], np.array([[a, b], [b, c]])
    y = off @ A
    far = np.linalg.norm(y, axis=1)
    n = y / far[:, None]
    slope = np.column_stack(
        [
            -n @ A,
            n[:, 0] * off[:, 0],
            n[:, 0] * off[:, 1] + n[:, 1] * off[:, 0],
            n[:, 1] * off[:, 1],
        ]
    )
    return far - 1.0, slope


def _unit(entries: Floats) -> Floats:
    """The three entries with determinant 1."""
    a, b, c = entries.tolist()
    return entries / (a * c - b * b) ** 0.5


def _variance(residual: Floats) -> float:
    """Of one residual; more where neighbours are alike, because then there are fewer."""
    spare = len(residual) - 5
    variance = float(residual @ residual) / max(1, spare)
    alike = float(residual[1:] @ residual[:-1]) / float(residual @ residual)
    alike = min(MOST_ALIKE, max(0.0, alike))
    return variance * (1.0 + alike) / (1.0 - alike)
