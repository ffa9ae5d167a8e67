"""The heading is lost and found again: after a step of the gyroscope's bias, and after a turn that
no sensor measured."""

from math import cos, pi, remainder

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.state import VehicleState
from tests.services.estimation.sensed import EARTH, QUICK, Sensed

# A gyroscope whose bias steps, on a vehicle that never rests.

TURNS = 0.3  # [rad/s]


def under_way(*, compass: bool = True) -> Sensed:
    vehicle = Sensed(seed=1, compass=compass)
    vehicle.run(5.0)
    vehicle.turn = lambda _: TURNS
    vehicle.run(3.0)
    return vehicle


def bend(vehicle: Sensed, bias: float) -> None:
    vehicle.more["rate"] = (bias, bias, bias)


def assert_right(state: VehicleState, turns: float = TURNS) -> None:
    assert state.heading.valid
    assert state.yaw_rate.valid
    assert state.yaw_rate.value == pytest.approx(turns, abs=0.03)


@pytest.mark.parametrize("bias", [0.1, -0.3])
def test_once_mended_heading_and_rate_are_known_again_while_it_turns(bias: float) -> None:
    vehicle = under_way()
    bend(vehicle, bias)
    state = vehicle.run(6.0)
    assert not state.yaw_rate.valid or abs(state.yaw_rate.value - TURNS) < 0.03
    bend(vehicle, 0.0)
    state = vehicle.run(30.0)
    assert_right(state)
    assert vehicle.counts["found:heading"] >= 1
    assert state.heading_navigation is not None
    assert cos(state.heading_navigation.value - vehicle.heading) > cos(0.1)
    assert any("compass measures" in text for _, text, _ in vehicle.estimator.outbox.said)


def test_a_step_that_lasts_is_learnt_from_the_magnetometer_while_it_turns() -> None:
    vehicle = under_way()
    bend(vehicle, 0.1)
    state = vehicle.run(40.0)
    assert_right(state)
    assert state.heading.std >= QUICK.attitude.compass_std  # known no better than from it


def test_without_a_magnetometer_a_step_that_lasts_loses_the_heading_until_it_rests() -> None:
    vehicle = under_way(compass=False)
    bend(vehicle, 0.1)
    state = vehicle.run(15.0)
    assert vehicle.counts["inconsistent:sensor/imu"] == 1
    assert not state.heading.valid
    assert not state.yaw_rate.valid
    bend(vehicle, 0.0)  # mended: at rest the bias of before is trusted again
    vehicle.turn = lambda _: 0.0
    assert_right(vehicle.run(40.0), turns=0.0)


def test_a_gyroscope_that_works_is_not_touched() -> None:
    vehicle = under_way()
    before = vehicle.checkpoint.gyro_bias
    assert_right(vehicle.run(8.0))
    assert vehicle.checkpoint.gyro_bias == pytest.approx(before, abs=5e-5)
    assert vehicle.counts["inconsistent:sensor/imu"] == 0


# A turn while the IMU is silent: the heading is unknown until the compass says.


def resting(*, compass: bool = True) -> Sensed:
    """Without noise but for the last digits, after its calibration."""
    vehicle = Sensed(compass=compass)
    vehicle.noise = {"force": 1e-7, "rate": 1e-7, "pressure": 0.1, "field": 1e-9}
    vehicle.run(5.0)
    return vehicle


def turn_unseen(vehicle: Sensed, by: float, seconds: float = 4.0) -> None:
    vehicle.absent |= {"imu", "pressure"}
    compass, vehicle.every["magnetometer"] = vehicle.every["magnetometer"], 10**9
    vehicle.turn = lambda _: by / seconds
    vehicle.run(seconds)
    vehicle.turn = lambda _: 0.0
    vehicle.absent -= {"imu", "pressure"}
    vehicle.every["magnetometer"] = compass


@settings(max_examples=10, deadline=None)
@given(by=st.floats(-3.0, 3.0), seconds=st.integers(1, 20))
def test_the_heading_is_unknown_until_the_compass_has_measured_the_turn(
    by: float, seconds: int
) -> None:
    vehicle = resting()
    turn_unseen(vehicle, by, seconds)
    state = vehicle.run(0.5)
    assert not state.heading.valid
    assert state.heading.std == pytest.approx(pi)
    assert state.heading_navigation is not None
    assert not state.heading_navigation.valid
    assert state.yaw_rate.valid  # the gyroscope is sound
    state = vehicle.run(2.0)
    assert state.heading.valid
    assert state.heading.std < 0.15
    assert state.heading_navigation is not None
    assert state.heading_navigation.valid
    off = 3.0 * state.heading.std
    for found in (state.heading, state.heading_navigation):
        assert remainder(found.value - by, 2.0 * pi) == pytest.approx(0.0, abs=off)
    assert vehicle.counts["found:heading"] == 1


def test_the_compass_turns_nothing_while_the_imu_is_silent() -> None:
    vehicle = resting()
    vehicle.absent, vehicle.heading = {"imu"}, 0.15
    vehicle.run(10.0)  # within the compass' gate
    vehicle.absent = set()
    assert vehicle.run(2.5).heading.value == pytest.approx(0.15, abs=0.05)


def test_near_iron_the_heading_stays_unknown() -> None:
    vehicle = resting()
    turn_unseen(vehicle, 1.0)
    vehicle.earth = (EARTH[0], EARTH[1], EARTH[2] + 20e-6)
    assert not vehicle.run(5.0).heading.valid
    vehicle.earth = EARTH
    assert vehicle.run(15.0).heading.value == pytest.approx(1.0, abs=0.1)


def test_after_a_short_silence_or_without_a_compass_the_heading_goes_on() -> None:
    vehicle = resting()
    turn_unseen(vehicle, 0.05, 0.3)
    assert vehicle.run(0.2).heading.valid
    vehicle = resting(compass=False)
    turn_unseen(vehicle, 1.0)
    state = vehicle.run(2.0)
    assert state.heading.valid
    assert state.heading.std > 1.0  # an honest spread
