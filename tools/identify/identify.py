"""From a recording to the numbers of the vehicle, and how well they predict another dive."""

from math import exp, log, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from services.marine.vehicle import Vehicle, driven, first_order
from services.runtime.config.errors import LindyError
from tools.identify.dive_data import (
    NO_SAMPLES,
    WINDOW_S,
    DiveData,
    busiest,
    fit_input,
    read,
    windows,
)
from tools.identify.fit import Fit, fit
from tools.identify.motion_model import (
    AXES,
    LAG,
    Beginning,
    Floats,
    Measured,
    coefficients,
    lagged,
    predict,
    start_of,
)
from tools.identify.results import weakly
from tools.identify.vehicle_file import VehicleFile, of_recording
from tools.recordings.recording import open_recording
from tools.tuning.lq import USUAL_TURN, USUAL_WAY, LoopName, design, lines

LAG_STEP = 1e-4  # [-] of a difference quotient in the logarithm
LAG_STEPS = 12
MOST_LAG_STEP = 0.5


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
    for _ in range(LAG_STEPS):
        here = expected(x)
        slope, left = (expected(x + LAG_STEP) - here) / LAG_STEP, measured - here
        information = float(np.sum(slope**2))
        if not information > 0.0:
            return None
        x += max(-MOST_LAG_STEP, min(MOST_LAG_STEP, float(np.sum(slope * left)) / information))
        if not log(1e-4) < x < log(10.0):
            return None
    left = measured - expected(x)
    std = sqrt(float(np.mean(left**2)) / information)
    return MeasuredLag(exp(x), exp(x) * std)


FEWEST_WINDOWS = 2
HOW = "fly the manoeuvres of `lindy identify plan`"


class Identified(NamedTuple):
    file: VehicleFile
    start: Beginning
    fit: Fit


def identify_dive(
    recording: Path, vehicle: str | None = None, axes: tuple[str, ...] = AXES
) -> Identified:
    """
    Args:
        vehicle: file to begin from; None: that of the recording.

    Raises:
        LindyError: there is no such recording, or it does not tell enough of any axis.
    """
    opened = open_recording(recording)
    file = of_recording(opened, vehicle)
    data, start = read(opened, file.vehicle, file.water, recording), start_of(file.vehicle)
    found = windows(data, file.vehicle)
    if len(found.t) < FEWEST_WINDOWS:
        most, times = max(found.refused.items(), key=lambda item: item[1])
        raise LindyError(
            f"{recording} {NO_SAMPLES}: {len(found.t)} stretches of {WINDOW_S:g} s can be used, "
            f"expected at least {FEWEST_WINDOWS}; {times * found.period:.0f} s: {most}"
        )
    result = fit(busiest(fit_input(data, found, file.vehicle, file.wake_share)), start, axes)
    if not result.axes:
        told = [f"{axis}: {weakly(*result.refused[axis])}" for axis in axes]
        raise LindyError(f"{recording} does not excite any axis enough; {'; '.join(told)}; {HOW}")
    if len(data.thrust) and (lag := measured_lag(data, file.vehicle)) is not None:
        result.x[LAG] = log(lag.seconds)
        result.covariance[LAG] = result.covariance[:, LAG] = 0.0
        result.covariance[LAG, LAG] = (lag.std / lag.seconds) ** 2
        no_curve = all(thruster.lag is None for thruster in file.vehicle.thruster)
        result = result._replace(lag=no_curve)
    return Identified(file, start, result)


def read_dive(recording: Path, file: VehicleFile) -> DiveData:
    """Another dive of the same vehicle."""
    return read(open_recording(recording), file.vehicle, file.water, recording)


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
    ahead = AHEAD_S[0]
    if not len((found := windows(data, before, ahead)).t):
        ahead = AHEAD_S[1]
        found = windows(data, before, ahead)
    if not len(found.t):
        raise LindyError(
            f"{name} has no {ahead:g} s in which the drone is armed, under water, and no thruster "
            f"is at its limit"
        )
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


LOOP: dict[str, LoopName] = {
    "heave": "depth", "yaw": "heading", "surge": "surge", "sway": "sway",
}  # fmt: skip


def proposed(vehicle: Vehicle, axes: tuple[str, ...], tree: dict[str, Any]) -> list[str]:
    """Lines of a vehicle file, as comments to be judged, for the loops of these axes.

    Args:
        tree: the vehicle file; its observers are kept.
    """
    found = ["Proposed gains (see `lindy gains`):"]
    for axis in axes:
        loop = LOOP[axis]
        worth = USUAL_TURN if loop == "heading" else USUAL_WAY
        observer = float(tree.get("control", {}).get(loop, {}).get("observer", 0.0))
        try:
            found += lines(loop, design(vehicle, loop, worth, observer), worth)
        except LindyError as why:
            found.append(str(why))
    return found
