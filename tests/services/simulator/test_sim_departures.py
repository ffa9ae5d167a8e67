"""What the simulator can have that the vehicle file does not say: a centre of gravity and sensors
that are elsewhere. Waves: test_sim_waves.py; vibration: test_sim_sensors.py."""

from math import atan2, sin

import pytest

from services.marine.attitude import from_euler, to_euler
from services.marine.mounting import ImuMount, Mounting
from services.marine.vehicle import GRAVITY
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.simulator.hull import Hull
from services.simulator.settings import Settings
from tests.services.simulator.hulls import (
    PIONEER,
    deep,
    simulator,
    vessel,
    world,
)


@pytest.mark.parametrize("shift", [0.005, -0.01])
def test_a_centre_of_gravity_further_ahead_lowers_the_nose(shift: float) -> None:
    """At rest, gravity and buoyancy are in line: tan θ = -x / height between them."""
    hull = vessel(deep(hull=Hull(gravity_shift=(shift, 0.0, 0.0))))
    hull.advance(40.0)
    _, pitch, _ = to_euler(hull.attitude)
    assert pitch == pytest.approx(atan2(-shift, PIONEER.metacentric_height), abs=1e-3)


def test_sensors_may_sit_elsewhere_than_the_file_says() -> None:
    real = Mounting(imu=ImuMount(rotation=((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))))
    place = Settings(mounting=real, gyro_bias=0.0, accelerometer_bias=0.0)
    sample = simulator(place, before=world(place, q_NB=from_euler(0.5, 0.0, 0.0))).imu()
    assert sample is not None
    # Gravity is to port as the vehicle leans to starboard; this IMU's x is the vehicle's -y.
    assert sample.specific_force[0] == pytest.approx(GRAVITY * sin(0.5), abs=0.1)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("waves={height=4.0, period=3.0, lines=1}", "break beyond 2.00 m, found 4 m"),
        ("waves={height=1.0, period=3.0}", "break beyond 0.94 m, found 1 m"),
        ("hull.gravity_shift=[1,0,0]", "gravity_shift"),
        ("sensor_errors.accelerometer_scale=[0,1,1]", "accelerometer_scale"),
        ("mounting.imu.rotation=[[1,0,0],[1,0,0],[0,0,1]]", "rotation is no rotation"),
    ],
)
def test_a_bad_value_is_one_sentence(setting: str, words: str) -> None:
    with pytest.raises(LindyError, match=words) as told:
        Stack(overrides=[f"simulator.{setting}"]).section("simulator", Settings)
    assert "\n" not in str(told.value)
