"""From a recording to the numbers of the vehicle."""

from math import log
from pathlib import Path
from typing import NamedTuple

from services.runtime.config.errors import LindyError
from tools.identify.dive_data import NO_SAMPLES, WINDOW_S, DiveData, read, windows
from tools.identify.fit import Fit, fit
from tools.identify.fit_input import busiest, fit_input
from tools.identify.measured_lag import measured_lag
from tools.identify.parameters import AXES, LAG, Beginning, start_of
from tools.identify.results import weakly
from tools.identify.vehicle_file import VehicleFile, of_recording
from tools.recordings.recording import open_recording

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
    data = read(opened, file.vehicle, file.water, recording)
    start = start_of(file.vehicle)
    return Identified(file, start, fitted(data, file, recording, axes))


def read_dive(recording: Path, file: VehicleFile) -> DiveData:
    """Another dive of the same vehicle."""
    return read(open_recording(recording), file.vehicle, file.water, recording)


def fitted(data: DiveData, file: VehicleFile, name: Path, axes: tuple[str, ...] = AXES) -> Fit:
    """
    Raises:
        LindyError: it does not tell enough of any axis.
    """
    found = windows(data, file.vehicle)
    if len(found.t) < FEWEST_WINDOWS:
        most, times = max(found.refused.items(), key=lambda item: item[1])
        raise LindyError(
            f"{name} {NO_SAMPLES}: {len(found.t)} stretches of {WINDOW_S:g} s can be used, "
            f"expected at least {FEWEST_WINDOWS}; {times * found.period:.0f} s: {most}"
        )
    taken = busiest(fit_input(data, found, file.vehicle, file.wake_share))
    result = fit(taken, start_of(file.vehicle), axes)
    if not result.axes:
        told = [f"{axis}: {weakly(*result.refused[axis])}" for axis in axes]
        raise LindyError(f"{name} does not excite any axis enough; {'; '.join(told)}; {HOW}")
    if len(data.thrust) and (lag := measured_lag(data, file.vehicle)) is not None:
        result.x[LAG] = log(lag.seconds)
        result.covariance[LAG] = result.covariance[:, LAG] = 0.0
        result.covariance[LAG, LAG] = (lag.std / lag.seconds) ** 2
        no_curve = all(thruster.lag is None for thruster in file.vehicle.thruster)
        return result._replace(lag=no_curve)
    return result
