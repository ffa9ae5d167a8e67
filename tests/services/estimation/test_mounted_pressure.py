"""A pressure sensor on an arm: the air above is that above the vehicle's origin, and tilting the
vehicle changes no depth."""

from math import pi, radians

import msgspec
import pytest

from messages.sensors import ImuSample, PressureSample
from messages.state import VehicleState
from messages.units import Vec3
from services.estimation.core import Estimator
from services.estimation.settings import CalibrationSettings, Settings
from services.marine.attitude import from_euler, to_body, to_world
from services.marine.mounting import Mounting, Placed
from services.marine.vehicle import ATMOSPHERE, GRAVITY, SEA_WATER, Vehicle
from services.runtime.config.stack import Stack

MS = 1_000_000  # [ns]
ARM: Vec3 = (0.6, 0.0, 0.4)  # [m]
QUICK = Settings(calibration=CalibrationSettings(still_time=3.0))  # [s] less to wait for


def test_a_pressure_sensor_on_an_arm_tells_the_depth_of_the_origin() -> None:
    pioneer = Stack().section("vehicle", Vehicle)
    floats = pioneer.floating_depth
    mounted = msgspec.structs.replace(pioneer, mounting=Mounting(pressure=Placed(position=ARM)))
    estimator = Estimator(QUICK, floats, None, mounted)
    state: VehicleState | None = None
    pitch = 0.0  # [rad] up by 30 degrees a second after calibration, within a second
    for k in range(600):
        now = (k + 1) * 10 * MS
        rate = radians(30.0) if 400 <= k < 500 else 0.0
        pitch += rate * 0.01
        q = from_euler(0.0, pitch, 0.0)
        force = to_body(q, (0.0, 0.0, -GRAVITY + 1e-4 * (-1) ** k))  # it never repeats itself
        sample = ImuSample(stamp_ns=now, specific_force=force, angular_rate=(0.0, rate, 0.0))
        state = estimator.imu(sample, now)
        water = SEA_WATER * GRAVITY * (floats + to_world(q, ARM)[2])
        said = ATMOSPHERE + water + 10.0 * (-1) ** k
        estimator.pressure(PressureSample(stamp_ns=now, pressure=said))
    kept = estimator.checkpoint(600 * 10 * MS)
    assert kept is not None
    assert kept.atmosphere == pytest.approx(ATMOSPHERE, abs=50.0)
    assert state is not None
    assert pitch == pytest.approx(pi / 6)
    assert state.pitch.value == pytest.approx(pitch, abs=0.02)
    assert state.depth.value == pytest.approx(floats, abs=0.02)  # and not 0.35 m shallower
