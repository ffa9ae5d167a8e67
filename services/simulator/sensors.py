"""Sensor models: biases, noise, rounding.

Every random number comes from the seed (streams.py). Biases have their own stream, so a simulator
restarted in mid-dive keeps the same biases.
"""

from collections.abc import Iterator
from math import sqrt

import numpy as np

from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.units import Quaternion, Vec3, Vec6
from services.marine.attitude import plus, to_body
from services.marine.mounting import Mounting
from services.marine.vehicle import GRAVITY
from services.marine.water import density_of
from services.simulator.settings import (
    MAGNETIC_FIELD,
    WATER_NOISE,
    WATER_TEMPERATURE,
    Dvl,
    SensorErrors,
    Settings,
    Usbl,
)
from services.simulator.streams import (
    ALTITUDE_NOISE,
    BIASES,
    DVL_NOISE,
    DVL_SCALE,
    FIELD_NOISE,
    GYRO_DRIFT,
    IMU_NOISE,
    PRESSURE_NOISE,
    USBL_NOISE,
    WATER_TEMPERATURES,
    wandering,
    white_noise,
)
from services.vehicle.mounting import MountedAxes, measured_there, seen_there

AT_THE_ORIGIN = Mounting()


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
        self._gyro_drift = wandering(
            seed, GYRO_DRIFT, settings.gyro_drift, settings.imu_rate, settings.gyro_drift_time
        )
        self._errors = settings.sensor_errors or SensorErrors()
        self._rounding = settings.accelerometer_step > 0.0 or settings.gyro_step > 0.0
        self._dvl_scale = next(white_noise(seed, DVL_SCALE, [1.0]))[0]
        self._dvl_noise = white_noise(seed, DVL_NOISE, [1.0] * 3)
        self._altitude_noise = white_noise(seed, ALTITUDE_NOISE, [1.0])
        self._usbl_noise = white_noise(seed, USBL_NOISE, [1.0] * 2)
        self._water_noise = white_noise(seed, WATER_TEMPERATURES, [WATER_NOISE])
        self.water: float | None = None  # [°C] as measured last
        self._pressure_noise = white_noise(seed, PRESSURE_NOISE, [settings.pressure_std])

    def imu(
        self,
        now: int,
        q_NB: Quaternion,
        nu: Vec6,
        nu_dot: Vec6,
        shaken: tuple[Vec3, Vec3] | None = None,
    ) -> ImuSample:
        """Specific force f = dv/dt + ω × v − R_BN g and angular rate (Fossen 2011, §11.5), with
        bias and noise.

        Args:
            nu, nu_dot: velocity and its derivative in the turning body frame, FRD.
            shaken: [m/s², rad/s] what vibration adds, in the sensor's axes.
        """
        u, v, w, p, q, r = nu
        a, b, c, *_ = nu_dot
        gx, gy, gz = to_body(q_NB, (0.0, 0.0, GRAVITY))
        force = (a + q * w - r * v - gx, b + r * u - p * w - gy, c + p * v - q * u - gz)
        force, (p, q, r) = measured_there(
            self._mounting.imu, self._imu_axes, force, (p, q, r), nu_dot[3:]
        )
        noise, (dp, dq, dr) = self._noise("sensor/imu", self._imu_noise), next(self._gyro_drift)
        # As this accelerometer and this gyroscope read it: known errors, bias, noise.
        (fx, fy, fz), (sx, sy, sz) = force, self._errors.accelerometer_scale
        (ox, oy, oz), (rx, ry, rz) = self._errors.accelerometer_offset, self._errors.gyro_offset
        (bx, by, bz), (bp, bq, br) = self.accelerometer_bias, self.gyro_bias
        nx, ny, nz, wp, wq, wr = noise
        force = (sx * fx + ox + bx + nx, sy * fy + oy + by + ny, sz * fz + oz + bz + nz)
        rate = (p + rx + dp + bp + wp, q + ry + dq + bq + wq, r + rz + dr + br + wr)
        if shaken is not None:
            force, rate = plus(force, shaken[0]), plus(rate, shaken[1])
        if self._rounding:
            force = rounded(force, self._settings.accelerometer_step)
            rate = rounded(rate, self._settings.gyro_step)
        return ImuSample(stamp_ns=now, specific_force=force, angular_rate=rate)

    def magnetometer(self, now: int, q_NB: Quaternion) -> MagnetometerSample:
        """The local field, with the vehicle's own iron and noise."""
        a, b, c = self._field_axes.to_sensor(to_body(q_NB, MAGNETIC_FIELD))
        # As this magnetometer reads it: known errors, the iron drawn by the seed, noise.
        (sx, sy, sz), (hx, hy, hz) = self._errors.soft_iron, self._errors.hard_iron
        ix, iy, iz = self.hard_iron
        nx, ny, nz = self._noise("sensor/magnetometer", self._field_noise)
        field = (
            sx[0] * a + sx[1] * b + sx[2] * c + hx + ix + nx,
            sy[0] * a + sy[1] * b + sy[2] * c + hy + iy + ny,
            sz[0] * a + sz[1] * b + sz[2] * c + hz + iz + nz,
        )
        if self._settings.magnetometer_step > 0.0:
            field = rounded(field, self._settings.magnetometer_step)
        return MagnetometerSample(stamp_ns=now, field=field)

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
        self.water = WATER_TEMPERATURE + next(self._water_noise)[0]
        return PressureSample(stamp_ns=now, pressure=pressure, temperature=self.water)

    def dvl(self, now: int, nu: Vec6, altitude: float, device: Dvl) -> DvlSample:
        """Sample for a velocity over the ground [m/s, rad/s], FRD; without one where the bottom [m]
        is out of range."""
        if not 0.0 < altitude <= device.reach:
            return DvlSample(stamp_ns=now, velocity=None, std=device.std)
        u, v, w, p, q, r = nu
        u, v, w = seen_there(self._mounting.dvl, self._dvl_axes, (u, v, w), (p, q, r))
        a, b, c = self._noise("sensor/dvl", self._dvl_noise)
        s, off = device.std, 1.0 + device.scale_error * self._dvl_scale
        measured = (off * u + s * a, off * v + s * b, off * w + s * c)
        (d,) = self._noise("sensor/dvl", self._altitude_noise)
        found = max(0.0, altitude + device.altitude_std * d)
        return DvlSample(stamp_ns=now, velocity=measured, std=s, altitude=found)

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


def rounded(v: Vec3, step: float) -> Vec3:
    """To whole steps, as a converter does; 0: not at all."""
    if step == 0.0:
        return v
    return round(v[0] / step) * step, round(v[1] / step) * step, round(v[2] / step) * step
