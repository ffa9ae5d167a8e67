"""Thrust of all motors for their outputs, and the inverse, from tables: the mixer asks often."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.marine.thrust_curve import CURVES
from services.marine.vehicle import Thruster

Floats = NDArray[np.float64]
PULSE_SPAN = 400.0  # [µs] of a motor from rest to full
POINTS = 3201  # of a table from -1 to 1: a quarter of a microsecond
STEP = 2.0 / (POINTS - 1)
FLAT = 0.5  # [N] least slope of a curve per share of the voltage that is divided by
EDGE = 1e-9  # [-] rounding


class MotorCurves:
    """All along the motors' own positive outputs."""

    def __init__(self, thrusters: Sequence[Thruster], senses: Floats) -> None:
        """
        Args:
            senses: [-] 1 where a positive output pushes along the thruster's direction, else -1.
        """
        self._grid = np.linspace(-1.0, 1.0, POINTS)
        self._table = np.array(
            [
                sense * _thrust(thruster, sense * self._grid)
                for thruster, sense in zip(thrusters, senses, strict=True)
            ]
        )
        self._slope = np.maximum(np.gradient(self._table, STEP, axis=1), FLAT)
        self._silent = np.array([_silent(thruster) for thruster in thrusters])
        self._dead_band = np.array([thruster.dead_band for thruster in thrusters])
        self._rows = np.arange(len(thrusters))

    def thrust(self, outputs: Floats) -> Floats:
        """[N] At which the motors settle; nothing inside their dead bands."""
        at = (np.clip(outputs, -1.0, 1.0) + 1.0) / STEP
        low = np.minimum(at.astype(int), POINTS - 2)
        share, rows = at - low, self._rows
        newtons = (1.0 - share) * self._table[rows, low] + share * self._table[rows, low + 1]
        return np.where(np.abs(outputs) < self._silent - EDGE, 0.0, newtons)

    def slopes(self, outputs: Floats) -> Floats:
        """[N] Per unit of output, of the curves without their dead bands."""
        at = np.rint((np.clip(outputs, -1.0, 1.0) + 1.0) / STEP).astype(int)
        return self._slope[self._rows, at]

    def outputs_for(self, thrust: Floats) -> Floats:
        """[-] Per motor. Thrust at the edge of a dead band gets 1 µs more, so that rounding does
        not silence the motor; less gets nothing."""
        outputs = np.zeros(len(thrust))
        for index, newtons in enumerate(thrust.tolist()):
            outputs[index] = np.interp(newtons, self._table[index], self._grid)
        edge = self._silent + 1.0 / PULSE_SPAN
        driven = np.abs(thrust) >= self._dead_band
        pushed = np.copysign(np.maximum(np.abs(outputs), edge), thrust)
        return np.where(driven & (thrust != 0.0), pushed, 0.0)


def _thrust(thruster: Thruster, shares: Floats) -> Floats:
    """[N] Along the thruster's direction, for shares -1 … 1 of the voltage, without dead band."""
    reverse, forward = thruster.limits
    curve = CURVES.get(thruster.curve)
    if curve is None:
        return np.where(shares > 0.0, shares * forward, -shares * reverse)
    newtons = np.array([curve.thrust(share) for share in np.clip(shares, -curve.top, curve.top)])
    return np.clip(newtons, reverse, forward)


def _silent(thruster: Thruster) -> float:
    """[-] Any smaller share does not turn the motor."""
    curve = CURVES.get(thruster.curve)
    return thruster.dead_band / thruster.max_thrust if curve is None else curve.silent
