"""The thrusters as control counts with them: a model of the wrench, which follows the command with
a lag."""

from dataclasses import dataclass
from math import exp

from messages.units import Vec6
from services.marine.vehicle import Vehicle, wrench_per_newton

REST: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
Lags = tuple[float, ...]


@dataclass(slots=True)
class ActuatorModel:
    """A model of the wrench, axis by axis, with the lag of each axis' slowest thruster."""

    lags: Lags  # [s] of the six axes
    _now: Vec6 = REST  # [N, N m]
    settles_at: Vec6 = REST  # [N, N m] at which the thrusters settle from now on

    def mean(self, dt: float) -> Vec6:
        """Advance by `dt` [s]; returns the mean wrench [N, N m] over that time."""
        if dt <= 0.0:
            return self._now
        means: list[float] = []
        after: list[float] = []
        for force, end, lag in zip(self._now, self.settles_at, self.lags, strict=True):
            left = exp(-dt / lag)
            means.append(end + (force - end) * (1 - left) * lag / dt)
            after.append(end + (force - end) * left)
        a, b, c, d, e, f = after
        self._now = a, b, c, d, e, f
        a, b, c, d, e, f = means
        return a, b, c, d, e, f


def lags_of(vehicle: Vehicle) -> Lags:
    """[s] Of each axis: the longest of the thrusters that act on it."""
    columns = [wrench_per_newton(thruster) for thruster in vehicle.thruster]
    slowest = max(thruster.time_constant for thruster in vehicle.thruster)
    lags = [
        [t.time_constant for t, column in zip(vehicle.thruster, columns, strict=True) if column[k]]
        for k in range(6)
    ]
    return tuple(max(acting, default=slowest) for acting in lags)
