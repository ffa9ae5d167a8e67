"""Calibration at the surface and at rest: gyroscope bias and atmosphere.

Uncalibrated, a small gyroscope drifts by tens of degrees of heading per minute; a few seconds of
averaging at rest bring that under one (Andrén 2023, section 5.3.2). Motion by waves or handling
must not enter the average, so any motion restarts it.

Duration: white noise of density n leaves n / √T in a mean over T seconds, and no filter does
better. A typical 0.007 °/s/√Hz is 0.42 °/min after 1 s, 0.24 after 3 s, 0.13 after 10 s. Bias drift
during a dive of five minutes adds 0.10 °/min (10 °/h, τ 300 s), which no calibration removes:
longer than 10 s gains little, shorter than 8 s misses 0.2 °/min.
"""

from dataclasses import dataclass
from math import hypot, inf
from typing import Annotated, NamedTuple

import msgspec

from messages.units import Vec3
from services.estimation.attitude.attitude_filter import tilt_of
from services.estimation.attitude.gyroscope import BLOCK, Mean
from services.estimation.attitude.heading import bearing
from services.estimation.line_fit import LineFit
from services.marine.attitude import from_euler
from services.marine.vehicle import GRAVITY

UpTo600 = Annotated[float, msgspec.Meta(gt=0.0, le=600.0)]
COUNTDOWN_STEP = 2.0  # [s] of rest between two messages to the pilot
# [rad/s], [m/s²] a larger std within half a second is motion
MOST_RATE_STD, MOST_FORCE_STD = 0.02, 0.2
MOST_CHANGE = 1500.0  # [Pa] of pressure in the whole rest, and 3 σ: 15 cm; more is no bobbing
ENOUGH_PRESSURES = 20  # samples; fewer do not average 5 mbar away


class CalibrationSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Limits of rest."""

    still_time: UpTo600 = 10.0  # [s] at rest without a break; 0.17 deg/min of drift, see above
    largest_bias: UpTo600 = 0.1  # [rad/s] a mean rate beyond this is a turn, not a bias
    # [Pa] of the air, as measured by something else; None: above the floating vehicle, at rest
    atmosphere: Annotated[float, msgspec.Meta(ge=50e3, le=120e3)] | None = None


@dataclass(frozen=True, slots=True)
class Calibrated:
    """The result of the calibration."""

    gyro_bias: Vec3  # [rad/s] FRD
    specific_force: Vec3  # [m/s²] FRD, mean
    pressure: float  # [Pa] mean
    pressures: int  # samples in that mean
    pressure_spread: float  # [Pa] std of one sample
    pressure_change: float  # [Pa] from the first to the last, where it is more than noise
    driven: bool  # the thrusters ran: it may not have floated
    heading: float | None  # [rad] magnetic; None without a magnetometer
    field: Vec3 | None  # [T] FRD, mean

    @property
    def accelerometer_bias(self) -> float:
        """[m/s²] along down: at rest the specific force should have the magnitude of gravity."""
        return GRAVITY - hypot(*self.specific_force)


class Unrest(NamedTuple):
    """The worst axis of half a second that was no rest."""

    rate: float  # [rad/s] mean
    rate_std: float  # [rad/s]
    force_std: float  # [m/s²]
    pressure: float  # [Pa] change since the rest began


class Calibration:
    """Averages over `still_time` of rest and at least `ENOUGH_PRESSURES` pressure samples."""

    def __init__(self, settings: CalibrationSettings) -> None:
        self._settings = settings
        self._moving = False
        self.unrest: Unrest | None = None  # None: at rest
        self.shaken = 0.0  # [m/s²] largest spread of the specific force since the last rest
        self._begin()

    def imu(self, rate: Vec3, specific_force: Vec3, dt: float) -> bool:
        """One sample [rad/s, m/s²], `dt` [s] after the previous one. True: the vehicle has begun to
        move and the average restarts (once per disturbance)."""
        self._block_seconds += dt
        self._block.add((*rate, *specific_force))
        if self._block.count < BLOCK:
            return False
        if self._is_still():
            self._moving, self.unrest, self.shaken = False, None, 0.0
            self._seconds += self._block_seconds
            self._total.add_all(self._block)
            self._block, self._block_seconds = Mean(6), 0.0
            return False
        disturbed = not self._moving
        self._moving = True
        spread, turns = self._block.std(), self._block.mean()[:3]
        self.unrest = Unrest(
            max(map(abs, turns)), max(spread[:3]), max(spread[3:]), self._pressure_change()[0]
        )
        self.shaken = max(self.shaken, self.unrest.force_std)
        self._begin()
        return disturbed

    def pressure(self, pressure: float) -> None:
        """One validated sample [Pa]."""
        count = self._pressures.count
        if count == 0:
            self._first_pressure = pressure
        self._pressures.add((pressure,))
        self._trend.add(float(count), pressure - self._first_pressure)

    def magnetometer(self, field: Vec3) -> None:
        """One validated sample [T], FRD."""
        self._fields.add(field)

    def drive(self) -> None:
        """The thrusters run."""
        self._driven = True

    @property
    def seconds_left(self) -> float:
        """[s] of rest still needed."""
        return max(0.0, self._settings.still_time - self._seconds)

    @property
    def lacks_pressure(self) -> bool:
        """Whether only pressure samples are missing."""
        return self._rested() and self._pressures.count < ENOUGH_PRESSURES

    def result(self) -> Calibrated | None:
        """The result; None until there are enough samples."""
        if not self._rested() or self.lacks_pressure:
            return None
        p, q, r, fx, fy, fz = self._total.mean()
        change, std = self._pressure_change()
        return Calibrated(
            gyro_bias=(p, q, r),
            specific_force=(fx, fy, fz),
            pressure=self._pressures.mean()[0],
            pressures=self._pressures.count,
            pressure_spread=self._trend.line(0.0).spread,
            pressure_change=change if abs(change) > 3.0 * std else 0.0,
            driven=self._driven,
            heading=self._heading((fx, fy, fz)),
            field=self._field(),
        )

    def _begin(self) -> None:
        self._seconds = self._block_seconds = 0.0
        self._block, self._total = Mean(6), Mean(6)
        self._pressures, self._fields = Mean(1), Mean(3)
        self._trend, self._first_pressure = LineFit(), 0.0
        self._driven = False

    def _pressure_change(self) -> tuple[float, float]:
        """[Pa] Since the rest began, by the line through all samples, and its 1σ."""
        if self._pressures.count < ENOUGH_PRESSURES:
            return 0.0, 0.0
        line, span = self._trend.line(0.0), self._pressures.count - 1
        return line.slope * span, line.slope_std * span

    def _is_still(self) -> bool:
        change, std = self._pressure_change()
        if abs(change) > MOST_CHANGE + 3.0 * std:
            return False  # one that rises steadily through the water feels nothing of it
        limits = [MOST_RATE_STD] * 3 + [MOST_FORCE_STD] * 3
        if any(std > limit for std, limit in zip(self._block.std(), limits, strict=True)):
            return False
        mean = self._block.mean()
        if any(abs(rate) > self._settings.largest_bias for rate in mean[:3]):
            return False
        if self._total.count == 0:
            return True
        before = zip(mean, self._total.mean(), limits, strict=True)
        return all(abs(new - old) <= limit for new, old, limit in before)

    def _rested(self) -> bool:
        # The very first sample has none before it: n samples span n - 1 periods.
        return self._total.count > 0 and self._seconds >= self._settings.still_time - 0.015

    def _heading(self, specific_force: Vec3) -> float | None:
        field = self._field()
        if field is None:
            return None
        return bearing(from_euler(*tilt_of(specific_force), 0.0), field)

    def _field(self) -> Vec3 | None:
        if self._fields.count == 0:
            return None
        x, y, z = self._fields.mean()
        return x, y, z


class Countdown:
    """Texts for the pilot with the remaining time at rest: at once, then every 2 s."""

    def __init__(self) -> None:
        self._next = inf  # [s] left

    def line(self, seconds_left: float) -> str | None:
        """The text to log now, if any."""
        if seconds_left <= 0.0 or seconds_left > self._next:
            return None
        self._next = seconds_left - COUNTDOWN_STEP
        return f"calibrating: {seconds_left:.0f} s at rest to go"
