"""Sensors measure the truth, plus exactly the errors their settings give them."""

from math import sqrt

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Quaternion, Vec6
from services.marine.attitude import from_euler, to_world
from services.marine.vehicle import GRAVITY
from services.simulator.sensors import Sensors
from services.simulator.settings import Dvl, Settings, Usbl

REST: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
motion = st.tuples(*[st.floats(-3, 3)] * 6)
attitude = st.builds(from_euler, st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))
law = settings(max_examples=50, deadline=None)


def perfect(**changes: float) -> Settings:
    none = Settings(
        gyro_bias=0.0,
        gyro_drift=0.0,
        gyro_noise=0.0,
        accelerometer_bias=0.0,
        accelerometer_noise=0.0,
        hard_iron=0.0,
        magnetometer_noise=0.0,
        pressure_std=0.0,
    )
    return msgspec.structs.replace(none, **changes)


def test_at_rest_the_imu_feels_gravity_upwards_and_its_bias() -> None:
    sensors = Sensors(Settings(gyro_noise=0.0, gyro_drift=0.0, accelerometer_noise=0.0), seed=3)
    sample = sensors.imu(7, LEVEL, REST, REST)
    ax, ay, az = sensors.accelerometer_bias
    assert sample.stamp_ns == 7
    assert sample.specific_force == pytest.approx((ax, ay, az - GRAVITY))
    assert sample.angular_rate == pytest.approx(sensors.gyro_bias)
    assert any(bias != 0 for bias in sensors.gyro_bias)


@law
@given(attitude, motion, motion)
def test_specific_force_is_the_acceleration_in_the_world_without_gravity(
    q_NB: Quaternion, nu: Vec6, nu_dot: Vec6
) -> None:
    sample = Sensors(perfect(), seed=0).imu(0, q_NB, nu, nu_dot)
    # Differentiate the world velocity R(t) v(t) numerically, with the body turning at ω.
    v, omega, dv = np.array(nu[:3]), np.array(nu[3:]), np.array(nu_dot[:3])
    in_world = np.array(to_world(q_NB, tuple(dv + np.cross(omega, v))))
    expected = in_world - np.array([0.0, 0.0, GRAVITY])
    assert to_world(q_NB, sample.specific_force) == pytest.approx(expected, abs=1e-9)
    assert sample.angular_rate == nu[3:]


@law
@given(attitude)
def test_the_magnetometer_turns_with_the_body_and_keeps_the_places_field(q_NB: Quaternion) -> None:
    sample = Sensors(perfect(), seed=0).magnetometer(0, q_NB)
    assert to_world(q_NB, sample.field) == pytest.approx((15e-6, 0.0, 49e-6), abs=1e-15)


def test_pressure_is_air_and_a_column_of_water() -> None:
    sensors = Sensors(perfect(atmosphere=100_000.0, water_density=1000.0), seed=0)
    assert sensors.pressure(0, 10.0).pressure == pytest.approx(100_000 + 98_100)
    assert sensors.pressure(0, -0.1).pressure == 100_000.0


def test_pressure_is_rounded_to_its_step() -> None:
    sensors = Sensors(perfect(pressure_std=300.0, pressure_step=500.0), seed=0)
    readings = {sensors.pressure(0, 5.0).pressure for _ in range(50)}
    assert len(readings) > 1
    assert all(reading % 500.0 == 0.0 for reading in readings)


def test_noise_has_the_strength_of_its_density_and_no_colour() -> None:
    settings = perfect(gyro_noise=1e-4, accelerometer_noise=2e-3)
    sensors = Sensors(settings, seed=5)
    samples = [sensors.imu(0, LEVEL, REST, REST) for _ in range(5000)]
    rates = np.array([s.angular_rate for s in samples])
    forces = np.array([s.specific_force for s in samples])
    assert rates.std(axis=0) == pytest.approx(1e-4 * sqrt(Settings().imu_rate), rel=0.05)
    assert forces.std(axis=0) == pytest.approx(2e-3 * sqrt(Settings().imu_rate), rel=0.05)
    assert abs(np.corrcoef(rates[1:, 0], rates[:-1, 0])[0, 1]) < 0.06
    assert abs(np.corrcoef(rates[:, 0], rates[:, 1])[0, 1]) < 0.06


def test_pressure_noise_is_as_strong_as_set() -> None:
    sensors = Sensors(Settings(pressure_std=500.0), seed=5)
    readings = np.array([sensors.pressure(0, 5.0).pressure for _ in range(4000)])
    assert readings.std() == pytest.approx(500.0, rel=0.05)


def test_biases_are_the_seeds_and_do_not_depend_on_what_was_measured() -> None:
    one, other = Sensors(Settings(), seed=1), Sensors(Settings(), seed=1)
    other.imu(0, LEVEL, REST, REST)
    assert one.gyro_bias == other.gyro_bias
    assert one.gyro_bias != Sensors(Settings(), seed=2).gyro_bias
    drawn = [Sensors(Settings(), seed).gyro_bias for seed in range(300)]
    assert np.array(drawn).std() == pytest.approx(0.0105, rel=0.1)


def test_the_gyroscopes_bias_wanders_slowly_and_from_zero() -> None:
    sensors = Sensors(perfect(gyro_drift=1e-4), seed=4)
    rates = np.array([sensors.imu(0, LEVEL, REST, REST).angular_rate for _ in range(60_000)])
    assert abs(rates[0]).max() < 1e-5
    assert 0.2e-4 < rates.std() < 2e-4
    assert abs(np.diff(rates, axis=0)).max() < 5e-6


def test_a_dvl_measures_the_velocity_over_ground_with_its_noise() -> None:
    sensors, device = Sensors(Settings(), seed=1), Dvl(std=0.02)
    samples = [sensors.dvl(5, (1.0, -0.5, 0.1, 0.0, 0.0, 0.0), 4.0, device) for _ in range(2000)]
    velocities = np.array([s.velocity for s in samples if s is not None])
    assert velocities.mean(axis=0) == pytest.approx((1.0, -0.5, 0.1), abs=2e-3)
    assert velocities.std(axis=0) == pytest.approx([0.02] * 3, rel=0.1)


@pytest.mark.parametrize("altitude", [-0.1, 0.0, 31.0])
def test_a_dvl_is_silent_without_a_bottom_in_reach(altitude: float) -> None:
    assert (
        Sensors(Settings(), seed=1).dvl(
            0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), altitude, Dvl(reach=30.0)
        )
        is None
    )


def test_a_usbl_fix_is_the_place_with_its_noise() -> None:
    sensors, device = Sensors(Settings(), seed=1), Usbl(std=0.5)
    fixes = np.array(
        [[(s := sensors.usbl(9, 3.0, -4.0, device)).north, s.east] for _ in range(2000)]
    )
    assert fixes.mean(axis=0) == pytest.approx((3.0, -4.0), abs=0.05)
    assert fixes.std(axis=0) == pytest.approx([0.5] * 2, rel=0.1)
