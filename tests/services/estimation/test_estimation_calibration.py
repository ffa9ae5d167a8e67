import numpy as np
import pytest

from messages.units import Vec3
from services.estimation.rest import Calibration
from services.estimation.settings import CalibrationSettings
from services.marine.vehicle import GRAVITY

QUICK = CalibrationSettings(still_time=3.0)  # [s] less to wait for
BIAS = np.array([0.01, -0.02, 0.03])  # [rad/s]
DT = 0.01  # [s]


def feed(
    calibration: Calibration, seconds: float, rate: Vec3 = (0.0, 0.0, 0.0), seed: int = 0
) -> int:
    """A vehicle that turns at `rate`; returns how often calibration said that it moves."""
    rng, moved = np.random.default_rng(seed), 0
    for k in range(round(seconds / DT)):
        p, q, r = (BIAS + np.array(rate) + 0.002 * rng.standard_normal(3)).tolist()
        fx, fy, fz = (np.array([0, 0, -GRAVITY]) + 0.02 * rng.standard_normal(3)).tolist()
        moved += calibration.imu((fx, fy, fz), (p, q, r), DT)
        if k % 2 == 0:
            calibration.pressures.append(101_325.0)
    return moved


def test_at_rest_the_bias_is_the_mean_rate():
    calibration = Calibration(QUICK)
    feed(calibration, 2.9)
    assert calibration.result() is None
    feed(calibration, 0.1)
    learnt = calibration.result()
    assert learnt is not None
    assert learnt.gyro_bias == pytest.approx(BIAS.tolist(), abs=5e-4)
    assert learnt.pressure == pytest.approx(101_325.0)
    assert learnt.field is None


def test_motion_begins_the_average_anew_and_is_said_once():
    calibration = Calibration(QUICK)
    feed(calibration, 2.5)
    assert feed(calibration, 5.0, rate=(0.0, 0.0, 0.5)) == 1
    feed(calibration, 2.5)
    assert calibration.result() is None
    feed(calibration, 0.5)
    learnt = calibration.result()
    assert learnt is not None
    assert learnt.gyro_bias == pytest.approx(BIAS.tolist(), abs=5e-4)


def test_a_steady_turn_is_motion_although_nothing_varies():
    calibration = Calibration(QUICK)
    assert feed(calibration, 10.0, rate=(0.0, 0.0, 0.2)) == 1
    assert calibration.result() is None


def test_a_slow_turn_that_begins_after_rest_is_motion():
    calibration = Calibration(QUICK)
    feed(calibration, 1.0)
    assert feed(calibration, 1.0, rate=(0.0, 0.04, 0.0)) == 1


def test_without_pressure_there_is_no_result():
    calibration = Calibration(QUICK)
    for _ in range(1000):
        calibration.imu((0.0, 0.0, -GRAVITY), (0.0, 0.0, 0.0), DT)
    assert calibration.result() is None
    assert calibration.lacks_pressure
