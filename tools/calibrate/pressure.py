"""The pressure sensor in the air: its offset from a barometer."""

from math import sqrt

import numpy as np

from messages.message import Message
from messages.sensors import PressureSample
from tools.calibrate.guide import CalibrationError, SensorFound, Setting

ENOUGH = 20.0  # [s]
LEAST, FEWEST = 10.0, 50  # [s] and samples of a recording
WANDERS = 300.0  # [Pa] of the mean of a second within the time: it is moved, or in the water
MOST = 20_000.0  # [Pa] of offset: more is water above it, or another unit


class PressureGuide:
    """Takes every sample: the sensor has to be in the air all the time."""

    def __init__(self, atmosphere: float) -> None:
        """`atmosphere`: [Pa] that a barometer shows at the place, not reduced to sea level."""
        self._atmosphere = atmosphere
        self._t: list[float] = []
        self._values: list[float] = []

    def see(self, sample: Message) -> None:
        if isinstance(sample, PressureSample):
            self._t.append(sample.stamp_ns * 1e-9)
            self._values.append(sample.pressure)

    @property
    def done(self) -> bool:
        return self._seconds >= ENOUGH and len(self._values) >= FEWEST

    @property
    def prompt(self) -> str:
        return f"keep the pressure sensor in the air: {self._seconds:.0f} of {ENOUGH:.0f} s"

    @property
    def _seconds(self) -> float:
        return self._t[-1] - self._t[0] if self._t else 0.0

    def result(self) -> SensorFound:
        """
        Raises:
            CalibrationError: too short, not steady, or not in the air.
        """
        if self._seconds < LEAST or len(self._values) < FEWEST:
            raise CalibrationError(
                f"pressure: {len(self._values)} samples in {self._seconds:.1f} s, needed are "
                f"{FEWEST} in {LEAST:.0f} s"
            )
        values, t = np.array(self._values), np.array(self._t)
        second = (t - t[0]).astype(int)
        means = np.array([values[second == i].mean() for i in np.unique(second)])
        std = float(values.std(ddof=1))
        per_second = len(values) / len(means)
        if float(np.ptp(means)) > WANDERS + 6.0 * std / sqrt(per_second):
            raise CalibrationError(
                f"pressure: it wanders by {np.ptp(means):.0f} Pa between seconds; keep the sensor "
                f"in the air, and still"
            )
        offset = float(values.mean()) - self._atmosphere
        if abs(offset) > MOST:
            raise CalibrationError(
                f"pressure: {values.mean():.0f} Pa is {offset:+.0f} Pa from the barometer, allowed "
                f"are {MOST:.0f}; is the sensor in the air, and the barometer in hPa?"
            )
        known = max(std / sqrt(len(values)), float(means.std(ddof=1)) / sqrt(len(means)))
        about = f"against {self._atmosphere / 100.0:.2f} hPa"
        return SensorFound(
            (Setting("pressure_offset", offset, (known,), "Pa", about),),
            (
                "pressure: the deviation is the sensor's noise alone, the barometer's error comes "
                "on top; each dive learns the air above it anew, so depth does not depend on this",
            ),
        )
