"""A vehicle whose sensors speak straight to an estimator, as the tests of this room move it."""

from collections import Counter
from collections.abc import Callable
from math import cos, sin
from typing import Self

import numpy as np

from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.state import VehicleState
from messages.units import Vec3
from services.estimation.checkpoint import EstimationCheckpoint
from services.estimation.core import Estimator
from services.estimation.settings import CalibrationSettings, Settings
from services.marine.vehicle import GRAVITY, SEA_WATER, Vehicle

QUICK = Settings(calibration=CalibrationSettings(still_time=3.0))  # [s] less to wait for
FLOATING = 0.168  # [m]
AIR = 100_900.0  # [Pa]
EARTH: Vec3 = (15e-6, 0.0, 49e-6)  # [T] NED; 51 µT, dip 73°
MS = 1_000_000  # [ns]
Law = Callable[[float], float]  # of seconds


class Sensed:
    """It floats at rest and level, until a test moves it or makes a sensor bad: `imu`, `pressure`,
    `magnetometer`, which read `force`, `rate`, `pressure` and `field`."""

    def __init__(
        self,
        settings: Settings = QUICK,
        *,
        seed: int = 0,
        checkpoint: EstimationCheckpoint | None = None,
        vehicle: Vehicle | None = None,
        compass: bool = True,
    ) -> None:
        self.estimator = Estimator(settings, FLOATING, checkpoint, vehicle)
        self.rng, self.ms = np.random.default_rng(seed), 0
        self.states = list[tuple[float, VehicleState]]()  # [s] when it was said
        self.depth: Law = lambda _: FLOATING  # [m]
        self.acceleration: Law = lambda _: 0.0  # [m/s²] down
        self.turn: Law = lambda _: 0.0  # [rad/s]
        self.heading = 0.0  # [rad]
        self.rolls = 0.0  # [rad] to and fro, every three seconds
        self.gravity: Vec3 = (0.0, 0.0, -GRAVITY)  # [m/s²] felt by a level vehicle
        self.earth: Vec3 = EARTH
        self.noise = {"force": 0.02, "rate": 1e-3, "pressure": 300.0, "field": 2e-7}
        self.more = dict[str, tuple[float, ...]]()  # that is read
        self.factor = dict[str, float]()  # of another unit
        self.age = dict[str, float]()  # [s] of a sensor's stamps
        self.every = {"imu": 10, "pressure": 20, "magnetometer": 10}  # [ms]
        self.absent = set[str]() if compass else {"magnetometer"}
        self.frozen = set[str]()
        self._last = dict[str, tuple[float, ...]]()

    def run(self, seconds: float) -> VehicleState:
        """The newest state."""
        self.go(seconds)
        return self.states[-1][1]

    def go(self, seconds: float) -> Self:
        for _ in range(round(100 * seconds)):
            self.ms += 10
            self.heading += 0.01 * self.turn(1e-3 * self.ms)
            if self._speaks("pressure"):
                (pressure,) = self._read("pressure", "pressure", (self._pressure(),))
                sample = PressureSample(stamp_ns=self._stamp("pressure"), pressure=pressure)
                self.estimator.pressure(sample)
            if self._speaks("magnetometer"):
                x, y, z = self._read("magnetometer", "field", self._field())
                stamp = self._stamp("magnetometer")
                self.estimator.magnetometer(MagnetometerSample(stamp_ns=stamp, field=(x, y, z)))
            if "imu" in self.absent:
                self._hear(self.estimator.silence(self.ms * MS))
            elif self._speaks("imu"):
                self.feel()
        return self

    def feel(self) -> VehicleState | None:
        """One sample of the IMU."""
        a, b, c = self._read("imu", "force", self._force())
        p, q, r = self._read("imu", "rate", self._rate())
        stamp = self._stamp("imu")
        sample = ImuSample(stamp_ns=stamp, specific_force=(a, b, c), angular_rate=(p, q, r))
        return self._hear(self.estimator.imu(sample, self.ms * MS))

    @property
    def roll(self) -> float:
        return self.rolls * sin(2e-3 * self.ms)

    @property
    def counts(self) -> Counter[str]:
        return self.estimator.outbox.counts

    @property
    def warnings(self) -> list[str]:
        return [text for level, text, _ in self.estimator.outbox.said if level == "warning"]

    @property
    def checkpoint(self) -> EstimationCheckpoint:
        kept = self.estimator.checkpoint(self.ms * MS)
        assert kept is not None
        return kept

    def _hear(self, state: VehicleState | None) -> VehicleState | None:
        if state is not None:
            self.states.append((1e-3 * self.ms, state))
        return state

    def _speaks(self, sensor: str) -> bool:
        return sensor not in self.absent and self.ms % self.every[sensor] == 0

    def _stamp(self, sensor: str) -> int:
        return self.ms * MS - round(1e9 * self.age.get(sensor, 0.0))

    def _read(self, sensor: str, what: str, true: tuple[float, ...]) -> tuple[float, ...]:
        if sensor not in self.frozen or what not in self._last:
            noise = (self.noise[what] * self.rng.standard_normal(len(true))).tolist()
            more, k = self.more.get(what, (0.0,) * len(true)), self.factor.get(what, 1.0)
            said = (k * (a + b + c) for a, b, c in zip(true, more, noise, strict=True))
            self._last[what] = tuple(said)
        return self._last[what]

    def _pressure(self) -> float:
        return AIR + SEA_WATER * GRAVITY * self.depth(1e-3 * self.ms)

    def _field(self) -> Vec3:
        n, e, d = self.earth
        c, s = cos(self.heading), sin(self.heading)
        return c * n + s * e, *self._rolled(c * e - s * n, d)

    def _force(self) -> Vec3:
        x, y, z = self.gravity
        return x, *self._rolled(y, z + self.acceleration(1e-3 * self.ms))

    def _rate(self) -> Vec3:
        return 2.0 * self.rolls * cos(2e-3 * self.ms), 0.0, self.turn(1e-3 * self.ms)

    def _rolled(self, y: float, z: float) -> tuple[float, float]:
        c, s = cos(self.roll), sin(self.roll)
        return c * y + s * z, c * z - s * y
