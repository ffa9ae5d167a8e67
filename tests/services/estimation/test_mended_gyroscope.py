"""A gyroscope whose bias steps, on a vehicle that never rests: heading and yaw rate come back."""

from collections import Counter
from math import cos, sin

import numpy as np
import pytest

from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.state import VehicleState
from services.estimation.core import Estimator
from services.estimation.settings import CalibrationSettings, Settings
from services.marine.vehicle import GRAVITY, SEA_WATER

QUICK = Settings(calibration=CalibrationSettings(still_time=3.0))  # [s] less to wait for
FLOATING = 0.168  # [m]
MS = 1_000_000  # [ns]
SURFACE = 100_900.0 + SEA_WATER * GRAVITY * FLOATING  # [Pa]
NORTH, DOWN = 15e-6, 49e-6  # [T]
TURNS = 0.3  # [rad/s]


class Turning:
    """A level vehicle that turns, with all its sensors."""

    def __init__(self, *, compass: bool) -> None:
        self.estimator = Estimator(QUICK, FLOATING)
        self.rng = np.random.default_rng(1)
        self.ms, self.heading, self.rate = 0, 0.0, 0.0
        self.bias = 0.0  # [rad/s] step, on all axes
        self.compass = compass

    def run(self, seconds: float) -> VehicleState:
        state: VehicleState | None = None
        for _ in range(round(seconds * 100)):
            self.ms += 10
            self.heading += 0.01 * self.rate
            at = self.ms * MS
            noise = self.rng.standard_normal(10).tolist()
            if self.ms % 20 == 0:
                pressure = SURFACE + 300.0 * noise[0]
                self.estimator.pressure(PressureSample(stamp_ns=at, pressure=pressure))
            if self.compass:
                x, y = NORTH * cos(self.heading), -NORTH * sin(self.heading)
                field = x + 2e-7 * noise[1], y + 2e-7 * noise[2], DOWN + 2e-7 * noise[3]
                self.estimator.magnetometer(MagnetometerSample(stamp_ns=at, field=field))
            force = 0.02 * noise[4], 0.02 * noise[5], 0.02 * noise[6] - GRAVITY
            p, q, r = (self.bias + 0.001 * each for each in noise[7:])
            sample = ImuSample(
                stamp_ns=at, specific_force=force, angular_rate=(p, q, r + self.rate)
            )
            state = self.estimator.imu(sample, at) or state
        assert state is not None
        return state

    @property
    def counts(self) -> Counter[str]:
        return self.estimator.outbox.counts


def under_way(*, compass: bool = True) -> Turning:
    vehicle = Turning(compass=compass)
    vehicle.run(5.0)
    vehicle.rate = TURNS
    vehicle.run(3.0)
    return vehicle


def assert_right(state: VehicleState, vehicle: Turning) -> None:
    assert state.heading.valid
    assert state.yaw_rate.valid
    assert state.yaw_rate.value == pytest.approx(vehicle.rate, abs=0.03)


@pytest.mark.parametrize("bias", [0.1, -0.3])
def test_once_mended_heading_and_rate_are_known_again_while_it_turns(bias: float) -> None:
    vehicle = under_way()
    vehicle.bias = bias
    state = vehicle.run(6.0)
    assert not state.yaw_rate.valid or abs(state.yaw_rate.value - vehicle.rate) < 0.03
    vehicle.bias = 0.0
    state = vehicle.run(40.0)
    assert_right(state, vehicle)
    assert vehicle.counts["found:heading"] >= 1
    assert state.heading_navigation is not None
    north = state.heading_navigation
    assert cos(north.value - vehicle.heading) > cos(0.1)
    assert any("compass measures" in text for _, text, _ in vehicle.estimator.outbox.said)


def test_a_step_that_lasts_is_learnt_from_the_magnetometer_while_it_turns() -> None:
    vehicle = under_way()
    vehicle.bias = 0.1
    state = vehicle.run(40.0)
    assert_right(state, vehicle)
    assert state.heading.std >= QUICK.attitude.compass_std  # known no better than from it


def test_without_a_magnetometer_a_step_that_lasts_leaves_the_heading_unknown() -> None:
    vehicle = under_way(compass=False)
    vehicle.bias = 0.1
    state = vehicle.run(25.0)
    assert vehicle.counts["inconsistent:sensor/imu"] == 1
    assert not state.heading.valid
    assert not state.yaw_rate.valid


def test_without_a_magnetometer_the_bias_of_before_is_trusted_again_at_rest() -> None:
    vehicle = under_way(compass=False)
    vehicle.bias = 0.1
    vehicle.run(6.0)
    vehicle.bias = vehicle.rate = 0.0
    assert_right(vehicle.run(40.0), vehicle)


def test_a_gyroscope_that_works_is_not_touched() -> None:
    vehicle = under_way()
    before = vehicle.estimator.checkpoint(0)
    state = vehicle.run(8.0)
    after = vehicle.estimator.checkpoint(0)
    assert before is not None
    assert after is not None
    assert after.gyro_bias == pytest.approx(before.gyro_bias, abs=5e-5)
    assert_right(state, vehicle)
    assert vehicle.counts["inconsistent:sensor/imu"] == 0
