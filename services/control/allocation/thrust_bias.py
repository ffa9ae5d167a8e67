"""Thrusters that run against each other, so that none of them stands in its dead-band.

Where there are more thrusters than axes, forces can be added that make no wrench at all: vectors b
with T b = 0. With enough of one every thruster of a set turns all the time, and the smallest force
is as exact as a large one: a drone with little drag holds its heading without being kicked to and
fro. Ships that keep their place do so too and call it thruster biasing. The price is the power of
thrusters that turn idly.
"""

from collections.abc import Collection, Sequence
from itertools import product
from math import copysign

import numpy as np
from numpy.typing import NDArray

from services.control.allocation.layout import AXES, Matrix

NOTHING = 1e-6  # [-] smaller parts are rounding
EVEN = 0.5  # [-] the smallest part of a bias over its largest; else it costs too much
Bias = list[tuple[int, float]]  # thruster, part of a newton
MOST = 2.0  # [-] of the dead-band; a bias that must be stronger is not worth its power
JUST_OUT = 1.001  # [-] of the dead-band; rounding must not lead back in
WELL_OUT = 1.25  # [-] of the dead-band; beyond it no bias is needed


class ThrustBias:
    """Sets of thrusters that can push against each other, and whether they do now."""

    def __init__(self, effect: Matrix, dead_bands: Sequence[float], axes: Collection[str]) -> None:
        """
        Args:
            effect: (6, n) wrench per newton; a column of zeros for a thruster to leave alone.
            dead_bands: (n,) [N]
            axes: thrusters that act on any of these are biased.
        """
        self._dead_bands = dead_bands
        rows = [AXES.index(axis) for axis in axes]
        acting = np.any(np.abs(effect[rows]) > NOTHING, axis=0)
        self.sets: list[Bias] = [
            [(index, float(bias[index])) for index in np.flatnonzero(bias).tolist()]
            for bias in (biases(effect) if axes else [])
            if np.any(acting & (bias != 0.0))
        ]
        self._on = [False] * len(self.sets)

    def added(self, forces: list[float], limits: Sequence[tuple[float, float]]) -> list[float]:
        """The same wrench by forces [N] outside the dead-bands, where that is possible.

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
        """With the least strength that makes every thruster of the set turn as its bias says."""
        strength = max(
            (copysign(JUST_OUT * self._dead_bands[index], part) - forces[index]) / part
            for index, part in bias
        )
        if strength > MOST * max(self._dead_bands[index] for index, _ in bias):
            return
        pushed = [(index, forces[index] + strength * part) for index, part in bias]
        if all(limits[index][0] <= force <= limits[index][1] for index, force in pushed):
            for index, force in pushed:
                forces[index] = force


def biases(effect: Matrix) -> list[Matrix]:
    """(n,) each: forces without a wrench, for sets of thrusters that have nothing to do with each
    other. The smallest part of each is 1 or -1. Thrusters that nothing can balance are in none.

    Args:
        effect: (6, n) wrench per newton.
    """
    counts = np.any(np.abs(effect) > NOTHING, axis=0)
    # What of a force goes into forces without a wrench: the projector onto the null space of T.
    idle = np.diag(counts.astype(float)) - np.linalg.pinv(effect) @ effect
    found: list[Matrix] = []
    for members in _sets(np.abs(idle) > NOTHING):
        best = max(
            (_within(idle, members, signs) for signs in product((1.0, -1.0), repeat=len(members))),
            key=_evenness,
        )
        if _evenness(best) >= EVEN:
            bias = np.zeros(len(counts))
            bias[members] = best / np.min(np.abs(best))
            found.append(bias)
    return found


def _within(idle: Matrix, members: list[int], signs: Sequence[float]) -> Matrix:
    return idle[np.ix_(members, members)] @ np.array(signs)


def _evenness(bias: Matrix) -> float:
    size = np.abs(bias)
    return float(size.min() / size.max()) if size.max() > NOTHING else 0.0


def _sets(linked: NDArray[np.bool_]) -> list[list[int]]:
    """Thrusters that are linked, directly or by others."""
    left = [index for index in range(len(linked)) if linked[index, index]]
    found: list[list[int]] = []
    while left:
        members = [left.pop(0)]
        for member in members:  # grows while it is read
            new = [index for index in left if linked[member, index]]
            members += new
            left = [index for index in left if index not in new]
        found.append(sorted(members))
    return found
