"""Thrust bias: thrusters run against each other, so that none of them is in its dead-band.

With more thrusters than axes, forces without any wrench can be added: vectors b with T b = 0. With
a large enough b every thruster of a set turns all the time, and small forces are as exact as large
ones: a drone with little drag holds its heading without a limit cycle. Dynamic positioning of ships
uses the same method, thruster biasing. The price is the power of the bias.
"""

from collections.abc import Collection, Sequence
from math import copysign

import numpy as np

from services.control.allocation.layout import AXES, Matrix, on_any_processor

ROUNDING = 1e-6  # [-] smaller parts are rounding
EVEN = 0.5  # [-] least ratio of smallest to largest part of a bias; below, it costs too much
Bias = list[tuple[int, float]]  # thruster, part of a newton
LARGEST_BIAS = 2.0  # [-] of the dead-band; a stronger bias is not worth its power
JUST_OUT = 1.001  # [-] of the dead-band; a margin for rounding
WELL_OUT = 1.25  # [-] of the dead-band; beyond it no bias is needed


class ThrustBias:
    """Sets of thrusters that can push against each other, and whether each set is biased now."""

    def __init__(self, effect: Matrix, dead_bands: Sequence[float], axes: Collection[str]) -> None:
        """
        Args:
            effect: (6, n) wrench per newton; a column of zeros excludes a thruster.
            dead_bands: (n,) [N]
            axes: thrusters that act on any of these are biased.
        """
        self._dead_bands = dead_bands
        rows = [AXES.index(axis) for axis in axes]
        acting = np.any(np.abs(effect[rows]) > ROUNDING, axis=0)
        self.sets: list[Bias] = [
            [(index, float(bias[index])) for index in np.flatnonzero(bias).tolist()]
            for bias in (biases(effect) if axes else [])
            if np.any(acting & (bias != 0.0))
        ]
        self._on = [False] * len(self.sets)

    def added(self, forces: list[float], limits: Sequence[tuple[float, float]]) -> list[float]:
        """Forces [N] of the same wrench outside the dead-bands, where that is possible.

        Args:
            forces: (n,) [N]
            limits: (n,) [N] lowest and highest of each thruster.
        """
        result = list(forces)
        for number, bias in enumerate(self.sets):
            enough = WELL_OUT if self._on[number] else 1.0
            self._on[number] = any(
                abs(forces[index]) < enough * self._dead_bands[index] for index, _ in bias
            )
            if self._on[number]:
                self._push_apart(result, bias, limits)
        return result

    def _push_apart(
        self, forces: list[float], bias: Bias, limits: Sequence[tuple[float, float]]
    ) -> None:
        """Add the weakest bias that takes every thruster of the set out of its dead-band."""
        strength = max(
            (copysign(JUST_OUT * self._dead_bands[index], part) - forces[index]) / part
            for index, part in bias
        )
        if strength > LARGEST_BIAS * max(self._dead_bands[index] for index, _ in bias):
            return
        pushed = [(index, forces[index] + strength * part) for index, part in bias]
        if all(limits[index][0] <= force <= limits[index][1] for index, force in pushed):
            for index, force in pushed:
                forces[index] = force


def biases(effect: Matrix) -> list[Matrix]:
    """(n,) each: forces without a wrench, one per independent set of thrusters that have one spare
    freedom. The smallest part of each is 1 or -1. Thrusters that cannot be balanced are in none.

    Args:
        effect: (6, n) wrench per newton.
    """
    counts = np.any(np.abs(effect) > ROUNDING, axis=0)
    # The projector into the null space. Where a set has one freedom, its columns are all along it.
    null = on_any_processor(np.diag(counts.astype(float)) - np.linalg.pinv(effect) @ effect)
    found: list[Matrix] = []
    left = {index for index in range(len(counts)) if null[index, index] > ROUNDING}
    while left:
        column = null[:, min(left)]
        members = np.flatnonzero(np.abs(column) > ROUNDING)
        left -= {min(left), *members.tolist()}
        parts = np.abs(column[members])
        one = abs(np.trace(null[np.ix_(members, members)]) - 1.0) < ROUNDING
        if one and parts.min() >= EVEN * parts.max():
            found.append(np.where(np.abs(column) > ROUNDING, column, 0.0) / parts.min())
    return found
