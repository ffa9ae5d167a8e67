"""A dive that begins without a rest: in mid-dive, as a log does, or on a boat that rocks."""

from math import cos, sin

import numpy as np
import pytest

from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.state import VehicleState
from messages.vehicle import Actuation
from services.estimation.core import Estimator
from services.estimation.settings import CalibrationSettings, Settings
from services.marine.vehicle import ATMOSPHERE, GRAVITY, SEA_WATER

MS = 1_000_000  # [ns]
BIAS = (0.02, -0.06, 0.01)  # [rad/s] of a gyroscope as it comes
DEPTH = 2.0  # [m]
ROUGH = "rough:calibration"


class Rocking:
    """A vehicle that rolls to and fro, with IMU and pressure, and a compass where it has one."""

    def __init__(self, settings: Settings | None = None, *, compass: bool = False) -> None:
        self.estimator = Estimator(settings or Settings(), 0.1)
        self.rng = np.random.default_rng(4)
        self.ms, self.roll, self.compass = 0, 0.0, compass
        self.rolls = 0.3  # [rad]
        self.factor = 1.0  # of the gyroscope's unit
        self.began: float | None = None  # [s] when it was running

    def run(self, seconds: float) -> VehicleState:
        state: VehicleState | None = None
        for _ in range(round(100 * seconds)):
            self.ms += 10
            t, at = 1e-3 * self.ms, self.ms * MS
            rate = 2.0 * self.rolls * cos(2.0 * t)
            self.roll = self.rolls * sin(2.0 * t)
            a, b, c, p, q, r, h = (0.02 * self.rng.standard_normal(7)).tolist()
            if self.ms % 50 == 0:
                said = ATMOSPHERE + SEA_WATER * GRAVITY * DEPTH + 2000.0 * h
                self.estimator.pressure(PressureSample(stamp_ns=at, pressure=said))
            if self.compass and self.ms % 20 == 0:
                north, down = 15e-6, 49e-6
                field = north, down * sin(self.roll), down * cos(self.roll)
                self.estimator.magnetometer(MagnetometerSample(stamp_ns=at, field=field))
            force = a, -GRAVITY * sin(self.roll) + b, -GRAVITY * cos(self.roll) + c
            turned = rate + BIAS[0] + 0.05 * p, BIAS[1] + 0.05 * q, BIAS[2] + 0.05 * r
            x, y, z = (self.factor * each for each in turned)
            sample = ImuSample(stamp_ns=at, specific_force=force, angular_rate=(x, y, z))
            state = self.estimator.imu(sample, at) or state
            if self.began is None and state is not None and state.phase == "running":
                self.began = t
        assert state is not None
        return state


def test_it_begins_within_some_seconds_and_learns_the_bias_from_gravity():
    vehicle = Rocking()
    state = vehicle.run(20.0)
    assert vehicle.began is not None
    assert vehicle.began < 6.0
    assert ROUGH in (state.troubles or ())
    assert state.roll.valid
    assert state.depth.valid
    assert state.roll.value == pytest.approx(vehicle.roll, abs=0.02)
    assert abs(state.pitch.value) < 0.02
    assert state.depth.value == pytest.approx(DEPTH, abs=3.0 * state.depth.std)
    assert vehicle.estimator.outbox.counts["inconsistent:sensor/imu"] == 0


def test_the_first_rest_calibrates_it():
    vehicle = Rocking()
    vehicle.run(20.42)  # level
    vehicle.rolls = 0.0
    state = vehicle.run(12.0)
    assert ROUGH not in (state.troubles or ())
    kept = vehicle.estimator.checkpoint(vehicle.ms * MS)
    assert kept is not None
    assert kept.gyro_bias == pytest.approx(BIAS, abs=1e-3)
    heading = state.heading
    assert vehicle.run(30.0).heading.std < heading.std + 0.01


def test_a_heading_that_thrusters_hold_is_no_rest():
    """By a wrong bias it is held so that the gyroscope reads just that."""
    vehicle = Rocking()
    vehicle.run(20.42)  # level
    vehicle.rolls = 0.0
    state = vehicle.run(0.1)
    for _ in range(120):
        at = vehicle.ms * MS
        vehicle.estimator.actuation(
            Actuation(
                stamp_ns=at, thrust=(3.0, -3.0), measured=True, actuated_ns=at, sensor_ns=at,
                pilot_ns=None, stale=False, power=40.0,
            )
        )  # fmt: skip
        state = vehicle.run(0.1)
    assert ROUGH in (state.troubles or ())
    assert ROUGH not in (vehicle.run(12.0).troubles or ())


def test_a_compass_shows_the_bias_about_the_vertical():
    vehicle = Rocking(compass=True)
    vehicle.run(60.0)
    before = vehicle.run(0.1).heading.value
    assert vehicle.run(20.0).heading.value == pytest.approx(before, abs=0.03)  # 0.2 by the bias


def test_a_pressure_of_the_air_that_the_file_gives_makes_the_depth_known():
    given = Settings(calibration=CalibrationSettings(atmosphere=ATMOSPHERE))
    state = Rocking(given).run(20.0)
    assert state.depth.std < 0.05
    assert state.depth.value == pytest.approx(DEPTH, abs=0.05)


def test_a_gyroscope_in_the_wrong_unit_does_not_begin_a_dive():
    vehicle = Rocking()
    vehicle.factor = 57.3
    vehicle.run(20.0)
    assert vehicle.began is None
