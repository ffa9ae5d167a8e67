"""Sensor models: biases, noise, rounding.

Every random number comes from the seed. Biases have their own stream, so a simulator restarted in
mid-dive keeps the same biases.
"""

from collections.abc import Iterator, Sequence
from math import exp, sqrt

import numpy as np

from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.units import Quaternion, Vec3, Vec6
from services.marine.attitude import to_body
from services.marine.mounting import Mounting
from services.marine.vehicle import GRAVITY
from services.marine.water import density_of
from services.simulator.sensor_errors import SensorErrors
from services.simulator.settings import Dvl, Settings, Usbl
from services.vehicle.mounting import MountedAxes, measured_there, seen_there

AT_THE_ORIGIN = Mounting()
BLOCK = 1024  # samples whose noise is drawn at once, because a single draw is slow
DRIFT_TIME = 300.0  # [s] correlation time of the bias drift
# Random streams.
(
    BIASES,
    IMU_NOISE,
    FIELD_NOISE,
    PRESSURE_NOISE,
    DVL_NOISE,
    USBL_NOISE,
    GYRO_DRIFT,
    CURRENT,
    VIBRATION,
) = range(9)


class Sensors:
    def __init__(self, settings: Settings, seed: int, mounting: Mounting = AT_THE_ORIGIN) -> None:
        """
        Args:
            seed: [-] 0 or more; the same seed gives the same biases and noise.
            mounting: samples are in the sensors' own positions and axes, as from real ones.
        """
        self._mounting = mounting
        self._imu_axes, self._dvl_axes = MountedAxes(mounting.imu), MountedAxes(mounting.dvl)
        self._field_axes = MountedAxes(mounting.magnetometer)
        drawn = np.random.default_rng([seed, BIASES]).standard_normal((3, 3))
        one_std = np.array(
            [[settings.gyro_bias], [settings.accelerometer_bias], [settings.hard_iron]]
        )
        self.gyro_bias, self.accelerometer_bias, self.hard_iron = (drawn * one_std).tolist()
        self.noise_times: dict[str, float] = {}  # [-] how much more noise, by key
        self._settings = settings
        # A white sample of a noise density n held for 1/f seconds has the standard deviation n √f.
        root = sqrt(settings.imu_rate)
        imu = [settings.accelerometer_noise * root] * 3 + [settings.gyro_noise * root] * 3
        self._imu_noise = white_noise(seed, IMU_NOISE, imu)
        self._field_noise = white_noise(seed, FIELD_NOISE, [settings.magnetometer_noise] * 3)
        self._gyro_drift = wandering(seed, GYRO_DRIFT, settings.gyro_drift, settings.imu_rate)
        self._errors = settings.sensor_errors or SensorErrors()
        self._vibration = None
        if (shaking := settings.vibration) is not None:
            stds = [shaking.force] * 3 + [shaking.rate] * 3
            self._vibration = white_noise(seed, VIBRATION, stds)
        self._dvl_noise = white_noise(seed, DVL_NOISE, [1.0] * 3)
        self._usbl_noise = white_noise(seed, USBL_NOISE, [1.0] * 2)
        self._pressure_noise = white_noise(seed, PRESSURE_NOISE, [settings.pressure_std])

    def imu(
        self, now: int, q_NB: Quaternion, nu: Vec6, nu_dot: Vec6, effort: float = 0.0
    ) -> ImuSample:
        """Specific force f = dv/dt + ω × v − R_BN g and angular rate (Fossen 2011, §11.5), with
        bias and noise.

        Args:
            nu, nu_dot: velocity and its derivative in the turning body frame, FRD.
            effort: [-] of the thrusters, 1 is all of them at their limits.
        """
        u, v, w, p, q, r = nu
        a, b, c, *_ = nu_dot
        gx, gy, gz = to_body(q_NB, (0.0, 0.0, GRAVITY))
        force = (a + q * w - r * v - gx, b + r * u - p * w - gy, c + p * v - q * u - gz)
        force, (p, q, r) = measured_there(
            self._mounting.imu, self._imu_axes, force, (p, q, r), nu_dot[3:]
        )
        noise, (dp, dq, dr) = self._noise("sensor/imu", self._imu_noise), next(self._gyro_drift)
        if self._vibration is not None:
            shaken = next(self._vibration)
            noise = [n + effort * s for n, s in zip(noise, shaken, strict=True)]
        force, (p, q, r) = self._errors.force(force), self._errors.rate((p, q, r))
        return ImuSample(
            stamp_ns=now,
            specific_force=_sum(force, self.accelerometer_bias, noise[:3]),
            angular_rate=_sum((p + dp, q + dq, r + dr), self.gyro_bias, noise[3:]),
        )

    def magnetometer(self, now: int, q_NB: Quaternion) -> MagnetometerSample:
        """The local field, with the vehicle's own iron and noise."""
        field = self._field_axes.to_sensor(to_body(q_NB, self._settings.magnetic_field))
        field = self._errors.field(field)
        return MagnetometerSample(
            stamp_ns=now,
            field=_sum(
                field, self.hard_iron, self._noise("sensor/magnetometer", self._field_noise)
            ),
        )

    def pressure(self, now: int, depth: float, rise: float = 0.0) -> PressureSample:
        """Absolute pressure at a depth [m]: air above, a column of water below the surface, which a
        wave makes higher by `rise` [m]."""
        place = self._settings
        water = density_of(place.water_density) * GRAVITY * max(0.0, depth + rise)
        pressure = (
            place.atmosphere + water + self._noise("sensor/pressure", self._pressure_noise)[0]
        )
        pressure += self._errors.pressure_offset
        if place.pressure_step > 0:
            pressure = round(pressure / place.pressure_step) * place.pressure_step
        return PressureSample(stamp_ns=now, pressure=pressure, temperature=place.water_temperature)

    def dvl(self, now: int, nu: Vec6, altitude: float, device: Dvl) -> DvlSample | None:
        """Sample for a velocity over the ground [m/s, rad/s], FRD; None when the bottom [m] is out
        of range."""
        if not 0.0 < altitude <= device.reach:
            return None
        u, v, w, p, q, r = nu
        u, v, w = seen_there(self._mounting.dvl, self._dvl_axes, (u, v, w), (p, q, r))
        a, b, c = self._noise("sensor/dvl", self._dvl_noise)
        s = device.std
        measured = (u + s * a, v + s * b, w + s * c)
        return DvlSample(stamp_ns=now, velocity=measured, std=s, altitude=altitude)

    def usbl(self, now: int, north: float, east: float, device: Usbl) -> UsblSample:
        """Position [m], NED, with noise."""
        a, b = self._noise("sensor/usbl", self._usbl_noise)
        s = device.std
        return UsblSample(stamp_ns=now, north=north + s * a, east=east + s * b, std=s)

    def _noise(self, key: str, source: Iterator[list[float]]) -> list[float]:
        noise = next(source)
        if key not in self.noise_times:
            return noise
        times = self.noise_times[key]
        return [times * value for value in noise]


def wandering(seed: int, stream: int, std: float, hz: float) -> Iterator[list[float]]:
    """Endless samples of three independent first-order Gauss-Markov processes at `hz` [1/s], zero
    at first, with the standard deviation `std` in the long run."""
    keep = exp(-1.0 / (hz * DRIFT_TIME))
    p = q = r = 0.0
    for a, b, c in white_noise(seed, stream, [std * sqrt(1.0 - keep * keep)] * 3):
        p, q, r = keep * p + a, keep * q + b, keep * r + c
        yield [p, q, r]


def white_noise(seed: int, stream: int, std: Sequence[float]) -> Iterator[list[float]]:
    """Endless samples of independent Gaussian noise, one number per standard deviation."""
    rng = np.random.default_rng([seed, stream])
    while True:
        yield from (rng.standard_normal((BLOCK, len(std))) * np.array(std)).tolist()


def _sum(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> Vec3:
    return a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2]
