"""Unstable gains are refused before they reach a thruster.

Stability of the loop as it runs: sampled, with one step of delay, thruster lag, and the rate
behind its low-pass.

Between samples the plant (inertia and linear drag) and the thrusters' first-order lag are solved
exactly for a held command. A command takes effect one step after its state. The rate of the state
follows the plant's by the estimator's first-order low-pass, if it has one: position and the other
rates come from an estimator that integrates an accelerometer or a gyroscope, without a lag. The
loop is linear, so its matrix is found by stepping each unit state once; it is stable when all
eigenvalues lie inside the unit circle. Quadratic drag only adds damping and is left out.
"""

from dataclasses import dataclass
from math import expm1, tau

import numpy as np
from numpy.typing import NDArray

from services.control.axis.axis import Gains, StaticGains
from services.control.axis.plant import Plant, lags_of, plant_of
from services.control.laws import Settings
from services.marine.vehicle import Vehicle

ROWS = {"surge": 0, "sway": 1, "depth": 2, "heading": 5}
# [Hz] Of the low-pass of the yaw rate, YAW_RATE_CUTOFF in services/estimation/core.py.
YAW_RATE_CUTOFF = 8.0
ROUNDING = 1e-9  # [-] a loop without spring has an eigenvalue of exactly 1, give or take this
Matrix = NDArray[np.float64]
# States: position, velocity, thrust, delayed command, learnt compensation, the rate as it was seen
# and the thrust one step ago (for the observer, whose model of the thrusters is assumed exact).
STATES = 7


@dataclass(frozen=True, slots=True)
class SampledLoop:
    plant: Plant
    lag: float  # [s] of the thrusters
    period: float  # [s]
    rate_lag: float = 0.0  # [s] time constant of the low-pass of the rate; 0: none

    def radius(self, gains: Gains, feedback: Gains | StaticGains) -> float:
        """[-] Largest absolute eigenvalue; the loop is stable below 1.

        Args:
            gains: integral or observer.
            feedback: kp and kd in force, moving or static.
        """
        move = held(self.plant, self.lag, self.period)
        columns = [self._stepped(row, gains, feedback, move) for row in np.eye(STATES)]
        return float(np.abs(np.linalg.eigvals(np.array(columns).T)).max())

    def _stepped(
        self, state: Matrix, gains: Gains, feedback: Gains | StaticGains, move: Matrix
    ) -> Matrix:
        """The state one period later."""
        x, v, f, delayed, learnt, seen_before, mean_before = state
        follows = -expm1(-self.period / self.rate_lag) if self.rate_lag else 1.0
        seen = seen_before + follows * (v - seen_before)
        if gains.observer > 0.0:
            inertia = self.plant.sampled_inertia(self.period)
            disturbance = inertia * (seen - seen_before) / self.period
            disturbance += self.plant.linear * seen_before - mean_before
            learnt -= -expm1(-gains.observer * self.period) * (disturbance + learnt)
        else:
            learnt += -gains.ki * self.period * x
        command = learnt - feedback.kp * x - feedback.kd * seen
        x_new, v_new, f_new, mean = move @ (x, v, f, delayed)
        return np.array([x_new, v_new, f_new, command, learnt, seen, mean])


def held(plant: Plant, lag: float, period: float) -> Matrix:
    """(4, 4): position, velocity and thrust after a period, and the mean thrust over it, from
    position, velocity, thrust and command at its beginning. Exact (zero-order hold)."""
    rates = np.zeros((5, 5))  # x' = v, m v' = f - d v, T f' = u - f, u' = 0, impulse' = f
    rates[0, 1] = 1.0
    rates[1, 1], rates[1, 2] = -plant.linear / plant.inertia, 1.0 / plant.inertia
    rates[2, 2], rates[2, 3] = -1.0 / lag, 1.0 / lag
    rates[4, 2] = 1.0
    after = exponential(rates * period)
    return np.vstack([after[:3, :4], after[4:, :4] / period])


def exponential(matrix: Matrix) -> Matrix:
    """Matrix exponential: Taylor series with scaling and squaring."""
    halvings = max(0, int(np.ceil(np.log2(max(1e-300, np.abs(matrix).sum(axis=1).max())))) + 4)
    small = matrix / 2.0**halvings
    result = term = np.eye(len(matrix))
    for order in range(1, 14):
        term = term @ small / order
        result = result + term
    for _ in range(halvings):
        result = result @ result
    return result


def sampled_loop(vehicle: Vehicle, axis: str, period: float) -> SampledLoop:
    """The loop of an axis of `ROWS`, which is stepped each `period` [s]."""
    row = ROWS[axis]
    rate_lag = 1.0 / (tau * YAW_RATE_CUTOFF) if axis == "heading" else 0.0
    return SampledLoop(plant_of(vehicle, row), lags_of(vehicle)[row], period, rate_lag)


def require_stable(settings: Settings, vehicle: Vehicle, period: float) -> None:
    """
    Args:
        period: [s] of the loop.

    Raises:
        ValueError: names the table, its gains and the largest eigenvalue.
    """
    for name in ROWS:
        gains: Gains = getattr(settings, name)
        loop = sampled_loop(vehicle, name, period)
        _require(f"control.{name}", loop, gains, gains)
        if gains.static is not None:
            _require(f"control.{name}.static", loop, gains, gains.static)


def _require(table: str, loop: SampledLoop, gains: Gains, feedback: Gains | StaticGains) -> None:
    radius = loop.radius(gains, feedback)
    if radius <= 1.0 + ROUNDING:
        return
    learns = f"observer = {gains.observer:g}" if gains.observer else f"ki = {gains.ki:g}"
    raise ValueError(
        f"{table}: with kp = {feedback.kp:g}, kd = {feedback.kd:g} and {learns} the loop at "
        f"{1 / loop.period:g} Hz is not stable on this vehicle: its largest eigenvalue is "
        f"{radius:.4f}, allowed is 1"
    )
