"""How well two vehicles predict a dive from its thrust alone, a minute ahead or 20 seconds."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from tools.identify.dive_data import DiveData, Windows, windows
from tools.identify.fit_input import fit_input
from tools.identify.motion_model import Measured, coefficients, predict
from tools.identify.thrust import Floats

AHEAD_S = 60.0, 20.0  # [s] the first of which the dive holds a stretch


class PredictionError(NamedTuple):
    """Root mean square over all stretches."""

    depth_rate: float  # [m/s]
    yaw_rate: float  # [rad/s]


class Comparison(NamedTuple):
    stretches: int
    seconds: float  # of each
    before: PredictionError  # of the vehicle file
    after: PredictionError  # of the identified vehicle


def compare(
    data: DiveData, before: Vehicle, after: Vehicle, wake_share: float, name: Path
) -> Comparison:
    """
    Raises:
        LindyError: the dive has no such stretch.
    """
    for ahead in AHEAD_S:
        found = windows(data, before, ahead)
        if len(found.t):
            return _compared(data, found, ahead, before, after, wake_share)
    raise LindyError(
        f"{name} has no {min(AHEAD_S):g} s in which the drone is armed, under water, and no "
        "thruster is at its limit"
    )


def _compared(
    data: DiveData,
    found: Windows,
    ahead: float,
    before: Vehicle,
    after: Vehicle,
    wake_share: float,
) -> Comparison:
    n = found.t.shape[1]
    depth_rate = np.interp(found.t, data.state_t, data.state[:, 3])

    def error(vehicle: Vehicle) -> PredictionError:
        taken = fit_input(data, found, vehicle, wake_share)
        measured = Measured(
            found.period, taken.wrench[None], taken.mean[None], found.rates[..., :2],
            found.down[None],
        )  # fmt: skip
        motion = predict(coefficients([vehicle], wake_share), found.begin[None], measured)
        sinking = np.sum(motion.velocity[0, :, :, :3] * found.down[:, :n], axis=-1)
        return PredictionError(
            _rms(sinking - depth_rate), _rms(motion.velocity[0, ..., 3] - found.rates[..., 2])
        )

    return Comparison(len(found.t), ahead, error(before), error(after))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
