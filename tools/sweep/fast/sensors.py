"""IMU and pressure sensors of many dives: `services/simulator/sensors.py` in lanes.

Each dive has the random numbers that its seed has in the simulator, so that it can be compared with
the exact one sample by sample.
"""

from collections.abc import Iterator, Sequence
from math import exp, expm1, sqrt

import numpy as np

from services.marine.attitude import to_body
from services.marine.vehicle import GRAVITY
from services.marine.water import density_of
from services.simulator.settings import MAGNETIC_FIELD, Settings
from services.simulator.streams import (
    ACCELEROMETER_DRIFT,
    ACCELEROMETER_WALK,
    BIASES,
    BLOCK,
    FIELD_NOISE,
    GYRO_DRIFT,
    GYRO_WALK,
    IMU_NOISE,
    PRESSURE_NOISE,
    TEMPERATURE,
)
from tools.sweep.fast.lanes import Lanes, Lanes3
from tools.sweep.fast.vessel import Vessels


def white_noise(seeds: Sequence[int], stream: int, std: Sequence[float]) -> Iterator[Lanes]:
    """Endless samples (numbers, lanes): what `streams.white_noise` has for each seed."""
    generators = [np.random.default_rng([seed, stream]) for seed in seeds]
    scale = np.array(std)
    while True:
        drawn = [rng.standard_normal((BLOCK, len(std))) * scale for rng in generators]
        yield from np.ascontiguousarray(np.stack(drawn, axis=-1))


def wandering(
    seeds: Sequence[int], stream: int, std: float, hz: float, time_constant: float
) -> Iterator[Lanes]:
    keep = exp(-1.0 / (hz * time_constant))
    now = np.zeros((3, len(seeds)))
    for push in white_noise(seeds, stream, [std * sqrt(1.0 - keep * keep)] * 3):
        now = keep * now + push
        yield now


def walking(seeds: Sequence[int], stream: int, walk: float, hz: float) -> Iterator[Lanes]:
    now = np.zeros((3, len(seeds)))
    for push in white_noise(seeds, stream, [walk / sqrt(hz)] * 3):
        now = now + push
        yield now


class LaneSensors:
    def __init__(self, settings: Settings, seeds: Sequence[int]) -> None:
        s, hz = settings, settings.imu_rate
        self._settings, self._density = s, density_of(s.water_density)
        one_std = np.array([[s.gyro_bias], [s.accelerometer_bias], [s.hard_iron]])
        drawn = [
            np.random.default_rng([seed, BIASES]).standard_normal((3, 3)) * one_std
            for seed in seeds
        ]
        self._rate_bias, self._force_bias, self._iron = np.stack(drawn, axis=-1)
        imu = [s.accelerometer_noise * sqrt(hz)] * 3 + [s.gyro_noise * sqrt(hz)] * 3
        self._imu_noise = white_noise(seeds, IMU_NOISE, imu)
        self._field_noise = white_noise(seeds, FIELD_NOISE, [s.magnetometer_noise] * 3)
        self._field_period_ns, self._field_due_ns = round(1e9 / s.magnetometer_rate), 0
        self._pressure_noise = white_noise(seeds, PRESSURE_NOISE, [s.pressure_std])
        self._rate_changes = [wandering(seeds, GYRO_DRIFT, s.gyro_drift, hz, s.gyro_drift_time)]
        self._force_changes = list[Iterator[Lanes]]()
        if s.accelerometer_drift > 0.0:
            time = s.accelerometer_drift_time
            self._force_changes.append(
                wandering(seeds, ACCELEROMETER_DRIFT, s.accelerometer_drift, hz, time)
            )
        if s.accelerometer_walk > 0.0:
            self._force_changes.append(walking(seeds, ACCELEROMETER_WALK, s.accelerometer_walk, hz))
        if s.gyro_walk > 0.0:
            self._rate_changes.append(walking(seeds, GYRO_WALK, s.gyro_walk, hz))
        per_kelvin = next(white_noise(seeds, TEMPERATURE, [1.0] * 6))
        self._force_per_kelvin = s.accelerometer_temperature * per_kelvin[:3]
        self._rate_per_kelvin = s.gyro_temperature * per_kelvin[3:]

    def imu(self, seconds: float, vessels: Vessels) -> tuple[Lanes3, Lanes3]:
        """Specific force [m/s²] and angular rate [rad/s], FRD, `seconds` after the first sample."""
        (u, v, w, p, q, r), (a, b, c, *_) = vessels.velocity, vessels.acceleration
        gx, gy, gz = to_body(vessels.attitude, (0.0, 0.0, GRAVITY))
        true = a + q * w - r * v - gx, b + r * u - p * w - gy, c + p * v - q * u - gz
        noise = next(self._imu_noise)
        force = np.array(true) + self._force_bias + noise[:3]
        rate = np.array((p, q, r)) + self._rate_bias + noise[3:]
        for change in self._force_changes:
            force += next(change)
        for change in self._rate_changes:
            rate += next(change)
        if self._settings.warm_up:
            warmer = -self._settings.warm_up * expm1(-seconds / self._settings.warm_up_time)
            force += warmer * self._force_per_kelvin
            rate += warmer * self._rate_per_kelvin
        force = rounded(force, self._settings.accelerometer_step)
        rate = rounded(rate, self._settings.gyro_step)
        return (force[0], force[1], force[2]), (rate[0], rate[1], rate[2])

    def magnetometer(self, now: int, vessels: Vessels) -> Lanes | None:
        """[T] (3, lanes) with the IMU sample at `now` [ns], if one is due then."""
        if now < self._field_due_ns:
            return None
        period = self._field_period_ns
        self._field_due_ns = max(self._field_due_ns + period, now + period // 2)
        true = np.array(to_body(vessels.attitude, MAGNETIC_FIELD))
        return rounded(
            true + self._iron + next(self._field_noise), self._settings.magnetometer_step
        )

    def pressure(self, depth: Lanes) -> Lanes:
        """[Pa] At a depth [m]."""
        water = self._density * GRAVITY * np.maximum(0.0, depth)
        pressure = self._settings.atmosphere + water + next(self._pressure_noise)[0]
        return rounded(pressure, self._settings.pressure_step)


def rounded(values: Lanes, step: float) -> Lanes:
    """To whole steps; 0: not at all."""
    whole: Lanes = values if step == 0.0 else np.rint(values / step) * step
    return whole
