"""A vehicle that turns while its IMU is silent: the heading is unknown until the compass says."""

from math import cos, pi, remainder, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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


class Resting:
    """A level vehicle without noise but for the last digits, after its calibration."""

    def __init__(self, *, compass: bool = True) -> None:
        self.estimator = Estimator(QUICK, FLOATING)
        self.ms, self.heading, self.iron = 0, 0.0, 0.0
        self.imu, self.compass = True, compass
        self.run(5.0)

    def run(self, seconds: float) -> VehicleState:
        state: VehicleState | None = None
        for _ in range(round(seconds * 100)):
            self.ms += 10
            at, tiny = self.ms * MS, 1e-9 * (self.ms % 970)
            pressure = PressureSample(stamp_ns=at, pressure=SURFACE + 1e6 * tiny)
            self.estimator.pressure(pressure)
            if self.compass:
                x, y = NORTH * cos(self.heading), -NORTH * sin(self.heading)
                field = x + 1e-3 * tiny, y, DOWN + self.iron
                self.estimator.magnetometer(MagnetometerSample(stamp_ns=at, field=field))
            if self.imu:
                force, rate = (tiny, 0.0, -GRAVITY), (tiny, 0.0, 0.0)
                sample = ImuSample(stamp_ns=at, specific_force=force, angular_rate=rate)
                state = self.estimator.imu(sample, at) or state
            else:
                state = self.estimator.silence(at) or state
        assert state is not None
        return state

    def turn_unseen(self, by: float, seconds: float = 4.0) -> None:
        self.imu = False
        for _ in range(100):
            self.heading += by / 100.0
            self.run_silent(seconds / 100.0)
        self.imu = True

    def run_silent(self, seconds: float) -> None:
        self.estimator.silence(self.ms * MS)
        self.ms += round(1000.0 * seconds)


@settings(max_examples=10, deadline=None)
@given(by=st.floats(-3.0, 3.0), seconds=st.floats(1.0, 20.0))
def test_the_heading_is_unknown_until_the_compass_has_measured_the_turn(
    by: float, seconds: float
) -> None:
    vehicle = Resting()
    vehicle.turn_unseen(by, seconds)
    state = vehicle.run(0.5)
    assert not state.heading.valid
    assert state.heading.std == pytest.approx(pi)
    assert state.heading_navigation is not None
    assert not state.heading_navigation.valid
    assert state.yaw_rate.valid  # the gyroscope is sound
    state = vehicle.run(2.0)
    assert state.heading.valid
    off = 3.0 * state.heading.std
    assert remainder(state.heading.value - by, 2.0 * pi) == pytest.approx(0.0, abs=off)
    assert state.heading.std < 0.15
    assert state.heading_navigation is not None
    assert state.heading_navigation.valid
    north = state.heading_navigation.value
    assert remainder(north - by, 2.0 * pi) == pytest.approx(0.0, abs=off)
    assert vehicle.estimator.outbox.counts["found:heading"] == 1


def test_the_compass_turns_nothing_while_the_imu_is_silent() -> None:
    vehicle = Resting()
    vehicle.imu, vehicle.heading = False, 0.15
    vehicle.run(10.0)  # within the compass' gate
    vehicle.imu = True
    assert vehicle.run(2.5).heading.value == pytest.approx(0.15, abs=0.05)


def test_near_iron_the_heading_stays_unknown() -> None:
    vehicle = Resting()
    vehicle.turn_unseen(1.0)
    vehicle.iron = 20e-6
    assert not vehicle.run(5.0).heading.valid
    vehicle.iron = 0.0
    assert vehicle.run(15.0).heading.value == pytest.approx(1.0, abs=0.1)


def test_a_short_silence_leaves_the_heading_known() -> None:
    vehicle = Resting()
    vehicle.turn_unseen(0.05, 0.3)
    assert vehicle.run(0.2).heading.valid


def test_without_a_compass_the_heading_goes_on_with_an_honest_spread() -> None:
    vehicle = Resting(compass=False)
    vehicle.turn_unseen(1.0)
    state = vehicle.run(2.0)
    assert state.heading.valid
    assert state.heading.std > 1.0
