"""Thrust of all motors for their outputs, and the inverse, from tables: the mixer asks often."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from math import copysign

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
        grid = np.linspace(-1.0, 1.0, POINTS)
        table = np.array(
            [
                sense * _thrust(thruster, sense * grid)
                for thruster, sense in zip(thrusters, senses, strict=True)
            ]
        )
        slopes = np.maximum(np.gradient(table, STEP, axis=1), FLAT)
        # Lists: for a handful of motors Python is faster than an array library.
        self._tables: list[list[float]] = table.tolist()
        self._silent = [_silent(thruster) for thruster in thrusters]
        self._dead_bands = [thruster.dead_band for thruster in thrusters]
        turning = [silent - EDGE for silent in self._silent]
        self._motors = list(zip(turning, self._tables, slopes.tolist(), strict=True))

    def thrust(self, outputs: Floats) -> Floats:
        """[N] At which the motors settle; nothing inside their dead bands."""
        return self.thrust_and_slopes(outputs)[0]

    def thrust_and_slopes(self, outputs: Floats) -> tuple[Floats, Floats]:
        """[N] As `thrust`, and per unit of output the slopes of the curves without dead bands."""
        newtons, slopes = list[float](), list[float]()
        for output, (turning, table, slope) in zip(outputs.tolist(), self._motors, strict=True):
            at = (output + 1.0) / STEP
            at = 0.0 if at < 0.0 else at if at < POINTS - 1 else POINTS - 1.0
            slopes.append(slope[round(at)])
            if -turning < output < turning:  # most motors at most times
                newtons.append(0.0)
                continue
            low = int(at) if at < POINTS - 1 else POINTS - 2
            share = at - low
            newtons.append((1.0 - share) * table[low] + share * table[low + 1])
        return np.array(newtons), np.array(slopes)

    def outputs_for(self, thrust: Floats) -> Floats:
        """[-] Per motor. Thrust at the edge of a dead band gets 1 µs more, so that rounding does
        not silence the motor; less gets nothing."""
        found = list[float]()
        rows = zip(thrust.tolist(), self._tables, self._silent, self._dead_bands, strict=True)
        for newtons, table, silent, dead_band in rows:
            if newtons == 0.0 or abs(newtons) < dead_band:
                found.append(0.0)
                continue
            output = max(abs(_inverse(table, newtons)), silent + 1.0 / PULSE_SPAN)
            found.append(copysign(output, newtons))
        return np.array(found)


def _inverse(table: list[float], newtons: float) -> float:
    """[-] Output for a thrust, limited to the ends of the table, which never falls."""
    above = bisect_right(table, newtons)
    if above == 0:
        return -1.0
    if above == POINTS:
        return (bisect_left(table, newtons) * STEP - 1.0) if newtons == table[-1] else 1.0
    low, high = table[above - 1], table[above]
    return (above - 1 + (newtons - low) / (high - low)) * STEP - 1.0


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
