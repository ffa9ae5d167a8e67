"""The lag of thrusters whose thrust is measured: from the commands to the measured thrust."""

from math import exp, log, sqrt
from typing import NamedTuple

import numpy as np

from services.marine.vehicle import Vehicle, driven, first_order
from tools.identify.dive_data import DiveData
from tools.identify.thrust import Floats, lagged

STEP = 1e-4  # [-] of a difference quotient in the logarithm
STEPS = 12
LARGEST_STEP = 0.5


class MeasuredLag(NamedTuple):
    seconds: float
    std: float  # [s]


def measured_lag(data: DiveData, vehicle: Vehicle) -> MeasuredLag | None:
    """One lag for all thrusters, by Gauss-Newton; None: no thrust changed, or not as a first-order
    lag does."""
    pairs = list(zip(vehicle.thruster, data.commands.T, strict=True))
    settles = np.array([[driven(t, newtons) for newtons in row.tolist()] for t, row in pairs]).T
    inside = (data.thrust_t >= data.command_t[0]) & (data.thrust_t <= data.command_t[-1])
    at, measured = data.thrust_t[inside], data.thrust[inside]

    def expected(x: float) -> Floats:
        return lagged(data.command_t, settles, first_order(exp(x)), at).value

    information = 0.0
    x = log(float(np.median([thruster.time_constant for thruster in vehicle.thruster])))
    for _ in range(STEPS):
        here = expected(x)
        slope, left = (expected(x + STEP) - here) / STEP, measured - here
        information = float(np.sum(slope**2))
        if not information > 0.0:
            return None
        x += max(-LARGEST_STEP, min(LARGEST_STEP, float(np.sum(slope * left)) / information))
        if not log(1e-4) < x < log(10.0):
            return None
    left = measured - expected(x)
    std = sqrt(float(np.mean(left**2)) / information)
    return MeasuredLag(exp(x), exp(x) * std)
