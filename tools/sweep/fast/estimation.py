"""From the samples of many dives to their states: the calibration at rest, and the estimator's way
of a sample (`services/estimation/core.py`) in lanes."""

from typing import Any

import numpy as np

from services.estimation.attitude.gyroscope import BLOCK
from services.estimation.sensor_watch import FORCE_NOISE, GYRO_NOISE, MOST, NOISE_SAMPLES
from services.estimation.settings import Settings
from services.estimation.startup.calibration import ENOUGH_PRESSURES
from services.marine.vehicle import GRAVITY, Vehicle
from services.marine.water import density_of
from tools.sweep.fast.attitude import Attitudes, RestingBiases
from tools.sweep.fast.depth import Depths
from tools.sweep.fast.lanes import Lanes, Lanes3, Mask
from tools.sweep.fast.translation import ThrustSpeeds

# Squared second difference of each number; a larger one counts as that.
LARGEST = 6.0 * (MOST * np.array([[FORCE_NOISE]] * 3 + [[GYRO_NOISE]] * 3)) ** 2
ROUNDED = 0.015  # [s] as in `Calibration`: n samples span n - 1 periods


class NoiseWatches:
    """The noise of the IMU's samples by their second differences (`sensor_watch.NoiseWatch`)."""

    def __init__(self, count: int) -> None:
        self._variances = np.zeros((6, count))
        self._before: Lanes | None = None
        self._after: Lanes | None = None

    def add(self, content: Lanes) -> None:
        """One sample (6, lanes) [m/s² ×3, rad/s ×3]."""
        first, middle = self._before, self._after
        self._before, self._after = middle, content
        if first is not None and middle is not None:
            difference = first - 2.0 * middle + content
            square = np.minimum(difference * difference, LARGEST)
            self._variances += (square / 6.0 - self._variances) / NOISE_SAMPLES

    @property
    def variances(self) -> tuple[Lanes, Lanes]:
        """[m²/s⁴, rad²/s²] Of one number of force and rate."""
        force, rate = self._variances[:3], self._variances[3:]
        return (force[0] + force[1] + force[2]) / 3.0, (rate[0] + rate[1] + rate[2]) / 3.0


class Estimators:
    """`running` from the end of the calibration on."""

    def __init__(self, settings: Settings, vehicle: Vehicle, count: int) -> None:
        self.running = False
        self._settings = settings
        self._floating_depth = vehicle.floating_depth
        self._per_metre = density_of(settings.water_density) * GRAVITY
        self._noise = NoiseWatches(count)
        self._thrust_speed = ThrustSpeeds(vehicle, settings.horizontal.wake_share, count)
        self._sum, self._samples, self._seconds = np.zeros((6, count)), 0, 0.0
        self._pressure, self._pressures = np.zeros(count), 0
        self._field, self._fields = np.zeros((3, count)), 0

    @property
    def lost(self) -> Mask:
        """Lanes of which a sensor would be doubted."""
        return self.attitude.lost | self.depth.lost

    def actuation(self, thrust: Lanes) -> None:
        self._thrust_speed.actuation(thrust)

    def pressure(self, pressure: Lanes, stamp_ns: int) -> None:
        """[Pa]"""
        if self.running:
            self.depth.pressure(pressure, stamp_ns)
        else:
            self._pressure = self._pressure + pressure
            self._pressures += 1

    def magnetometer(self, field: Lanes) -> None:
        """[T] While it calibrates: later, the compass has no effect on the motion."""
        self._field = self._field + field
        self._fields += 1

    def imu(self, force: Lanes3, rate: Lanes3, stamp_ns: int, dt: float) -> None:
        """One sample [m/s², rad/s], `dt` [s] after the one before; 0: the first."""
        content = np.array((*force, *rate))
        self._noise.add(content)
        if self.running:
            self._follow(force, rate, stamp_ns, dt)
        else:
            self._calibrate(content, stamp_ns, dt)

    def _calibrate(self, content: Lanes, stamp_ns: int, dt: float) -> None:
        """The vehicle floats at rest."""
        self._sum += content
        self._samples += 1
        self._seconds += dt
        limits = self._settings.calibration
        rested = self._samples % BLOCK == 0 and self._seconds >= limits.still_time - ROUNDED
        if not rested or self._pressures < ENOUGH_PRESSURES:
            return
        mean, pressure = self._sum / self._samples, self._pressure / self._pressures
        force = mean[:3]
        count = len(pressure)
        air = pressure - self._per_metre * self._floating_depth
        if limits.atmosphere is not None:
            air = np.full(count, limits.atmosphere)
        # A thousand samples lie between two with another `dt`: the first has none.
        field = self._field / self._fields if self._fields else None
        self.attitude = Attitudes(self._settings.attitude, force, mean[3:], field, 0.01)
        self._resting = RestingBiases(count, limits.still_time, limits.largest_bias)
        lack = GRAVITY - np.sqrt(np.sum(force * force, axis=0))
        axes = self.attitude.axes((force[0], force[1], force[2]), np.zeros(count))
        self.depth = Depths(
            self._settings.depth, air, self._per_metre, pressure, self._pressures, lack,
            stamp_ns, axes,
        )  # fmt: skip
        self.running = True

    def _follow(self, force: Lanes3, rate: Lanes3, stamp_ns: int, dt: float) -> None:
        attitude, noise = self.attitude, self._noise.variances
        attitude.step(rate, force, noise, self._thrust_speed.felt)
        rested = self._resting.imu(rate, force, dt, attitude.bias)
        if rested is not None:
            (p, q, r), which = rested
            attitude.rested((p, q, r), which)
        axes: Any = attitude.axes(force, noise[0] * dt)
        p, q, r = [measured - bias for measured, bias in zip(rate, attitude.bias, strict=True)]
        axes = self._thrust_speed.step(axes, (p, q, r), self.depth.rate, dt)
        self.depth.predict(stamp_ns, axes)
