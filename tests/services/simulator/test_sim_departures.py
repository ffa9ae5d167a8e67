"""What the simulator can have that the vehicle file does not say: waves, sensor errors, vibration,
thrust that sags, centres that are elsewhere, sensors that sit elsewhere."""

from math import atan2, exp, hypot, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.control import ThrusterCommand
from messages.units import Quaternion, Vec3, Vec6
from services.marine.attitude import from_euler, to_euler
from services.marine.mounting import Mount, Mounting
from services.marine.vehicle import GRAVITY, Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.simulator.core import Simulator, at_the_surface
from services.simulator.hull import Hull, ShiftedCentres
from services.simulator.sensor_errors import SensorErrors, Vibration
from services.simulator.sensors import Sensors
from services.simulator.settings import Settings
from services.simulator.vessel import Vessel
from services.simulator.waves import Waves, water_at, wave_number

PIONEER = Stack().section("vehicle", Vehicle)
NEUTRAL = replace(PIONEER, net_buoyancy=0.0)
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
REST: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
SWELL = Waves(height=0.3, period=4.0)
MS = 1_000_000  # [ns]
places = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(0.0, 20.0))


@settings(max_examples=50, deadline=None)
@given(st.floats(4.1, 200.0), places, st.floats(-3.0, 3.0))
def test_a_wave_is_water_that_moves_under_its_own_pressure(
    t: float, place: Vec3, heading: float
) -> None:
    """The momentum equation of small motion: ρ a = -∇p, with the dynamic pressure ρ g rise; and
    the acceleration is the derivative of the velocity."""
    wave, d = Waves(height=0.3, period=4.0, heading=heading), 1e-5
    here = water_at(wave, t, place)
    for axis in range(2 + (place[2] > d)):
        ahead = tuple(x + d * (i == axis) for i, x in enumerate(place))
        behind = tuple(x - d * (i == axis) for i, x in enumerate(place))
        slope = water_at(wave, t, ahead).rise - water_at(wave, t, behind).rise  # type: ignore[arg-type]
        assert here.acceleration[axis] == pytest.approx(-GRAVITY * slope / (2 * d), abs=1e-5)
    later, before = water_at(wave, t + d, place), water_at(wave, t - d, place)
    change = np.subtract(later.velocity, before.velocity) / (2 * d)
    assert change == pytest.approx(here.acceleration, abs=1e-5)


def test_a_wave_fades_with_depth_and_before_it_begins_the_sea_is_calm() -> None:
    k = wave_number(4.0)
    for depth in (0.0, 2.0, 10.0):
        rises = [water_at(SWELL, 8.0 + 0.01 * n, (0.0, 0.0, depth)).rise for n in range(400)]
        assert max(rises) == pytest.approx(0.15 * exp(-k * depth), rel=1e-3)
    late = replace(SWELL, begins=30.0)
    assert water_at(late, 29.9, (0.0, 0.0, 1.0)).velocity == (0.0, 0.0, 0.0)


def pressures(waves: Waves | None, seconds: float = 12.0) -> np.ndarray:
    """[Pa] at a hull that lies 3 m deep and is left alone."""
    place = Settings(waves=waves, pressure_std=0.0)
    world = replace(at_the_surface(NEUTRAL, place), state=(0.0, 0.0, 3.0, *LEVEL, *REST))
    simulator, found = Simulator(NEUTRAL, place, 0, world), list[float]()
    for n in range(round(seconds * 42)):
        simulator.advance(round(n * 1e9 / 42))
        sample = simulator.pressure()
        assert sample is not None
        found.append(sample.pressure)
    return np.array(found)


def test_a_held_hull_feels_the_waves_pressure_and_one_that_is_carried_hardly_any() -> None:
    still = pressures(None)[0]
    held = pressures(replace(SWELL, moves_hull=False))
    most = 1025 * GRAVITY * 0.15 * exp(-wave_number(4.0) * 3.0)
    assert np.max(held[200:] - still) == pytest.approx(most, rel=0.01)
    # The water's own parcels keep their pressure, to the first order.
    assert np.ptp(pressures(SWELL)[200:]) < 0.25 * most


def test_a_carried_hull_goes_round_as_the_water_does_and_its_imu_feels_it() -> None:
    place = Settings(waves=SWELL)
    hull = Vessel(NEUTRAL, place, (0.0, 0.0, 3.0, *LEVEL, *REST), [0.0] * 4)
    radius = 0.15 * exp(-wave_number(4.0) * 3.0)
    depths, forces = list[float](), list[float]()
    for _ in range(3000):
        hull.advance(0.005)
        depths.append(hull.position[2])
        forces.append(hull.acceleration[2])
    # The drag of the hull's start from rest moves it less in the end than it seems.
    assert np.ptp(depths[1400:]) / 2 == pytest.approx(radius, rel=0.15)
    assert np.max(forces[1400:]) == pytest.approx(radius * (pi / 2) ** 2, rel=0.25)
    numbers = np.diff(depths[1400:], 2) / 0.005**2
    assert np.corrcoef(numbers, forces[1401:-1])[0, 1] > 0.99


def test_vibration_grows_with_the_thrusters_effort() -> None:
    quiet = Settings(accelerometer_noise=0.0, gyro_noise=0.0, gyro_drift=0.0)
    of = Sensors(replace(quiet, vibration=Vibration(force=2.0, rate=0.05)), 3)
    for effort in (0.0, 0.5, 1.0):
        samples = [of.imu(n, LEVEL, REST, REST, effort) for n in range(2000)]
        force = np.std([s.specific_force for s in samples], axis=0)
        assert force == pytest.approx([2.0 * effort] * 3, rel=0.06, abs=1e-12)
        rate = np.std([s.angular_rate for s in samples], axis=0)
        assert rate == pytest.approx([0.05 * effort] * 3, rel=0.06, abs=1e-12)


def test_the_effort_is_that_of_the_thrusters() -> None:
    hull = Vessel(PIONEER, Settings(), (0.0, 0.0, 3.0, *LEVEL, *REST), [0.0] * 4)
    hull.drive([35.0, -35.0, 0.0, 17.5])
    hull.advance(2.0)
    assert hull.effort == pytest.approx(2.5 / 4.0, rel=1e-3)


def full_ahead(exponent: float, used_wh: float) -> tuple[float, tuple[float, ...]]:
    """[m/s] of surge after 2 s, and the thrust [N] that is reported."""
    place = Settings(hull=Hull(voltage_exponent=exponent))
    world = at_the_surface(NEUTRAL, place)
    world = replace(world, state=(0.0, 0.0, 5.0, *LEVEL, *REST), used_wh=used_wh)
    simulator = Simulator(NEUTRAL, place, 0, world)
    for n in range(100):
        thrust, now = (35.0, 35.0, 0.0, 0.0), n * 20 * MS
        simulator.obey(
            ThrusterCommand(
                stamp_ns=now, sensor_ns=None, pilot_ns=None, thrust=thrust, armed=True
            ), now,
        )  # fmt: skip
    return simulator.truth().velocity[0], simulator.actuation().thrust


def test_thrust_sags_with_the_voltage_and_nobody_reports_it() -> None:
    fresh, sagging, empty = full_ahead(0.0, 90.0), full_ahead(2.0, 0.0), full_ahead(2.0, 90.0)
    assert fresh[0] > sagging[0] > empty[0]
    # 13.05 V of 16.8, and 0.03 Ω at 55 A: half the thrust is left, and 0.7 of the speed.
    assert empty[0] / fresh[0] == pytest.approx(0.7, abs=0.1)
    assert empty[1] == fresh[1]


@pytest.mark.parametrize("shift", [0.005, -0.01])
def test_a_centre_of_gravity_further_ahead_lowers_the_nose(shift: float) -> None:
    """At rest, gravity and buoyancy are in line: tan θ = -x / height between them."""
    place = Settings(hull=Hull(gravity_shift=(shift, 0.0, 0.0)), floor_depth=100.0)
    hull = Vessel(NEUTRAL, place, (0.0, 0.0, 50.0, *LEVEL, *REST), [0.0] * 4)
    hull.advance(60.0)
    _, pitch, _ = to_euler(hull.attitude)
    assert pitch == pytest.approx(atan2(-shift, PIONEER.metacentric_height), abs=1e-3)


@settings(max_examples=50, deadline=None)
@given(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_both_centres_shifted_alike_turn_a_neutral_hull_nowhere(
    roll: float, pitch: float, x: float, y: float
) -> None:
    hull = Hull(gravity_shift=(x, y, 0.01), buoyancy_shift=(x, y, 0.01))
    moment = ShiftedCentres(NEUTRAL, hull).moment(10.0, from_euler(roll, pitch, 0.0))
    assert hypot(*moment) < 1e-9


def test_sensors_may_sit_elsewhere_than_the_file_says() -> None:
    real = Mounting(imu=Mount(rotation=((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))))
    place = Settings(mounting=real, gyro_bias=0.0, accelerometer_bias=0.0)
    world = replace(
        at_the_surface(PIONEER, place), state=(0.0, 0.0, 5.0, *from_euler(0.5, 0.0, 0.0), *REST)
    )
    sample = Simulator(PIONEER, place, 0, world).imu()
    assert sample is not None
    # Gravity is to port as the vehicle leans to starboard; this IMU's x is the vehicle's -y.
    assert sample.specific_force[0] == pytest.approx(GRAVITY * np.sin(0.5), abs=0.1)


def test_known_errors_of_the_sensors_are_added_to_the_truth() -> None:
    wrong = SensorErrors(
        accelerometer_offset=(0.1, 0.2, 0.3),
        accelerometer_scale=(1.1, 1.0, 0.9),
        hard_iron=(1e-6, 0.0, 0.0),
        soft_iron=((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        pressure_offset=300.0,
    )
    good, bad = Sensors(Settings(), 1), Sensors(Settings(sensor_errors=wrong), 1)
    right, off = good.imu(0, LEVEL, REST, REST), bad.imu(0, LEVEL, REST, REST)
    change = np.subtract(off.specific_force, right.specific_force)
    assert change == pytest.approx([0.1, 0.2, 0.3 + 0.1 * GRAVITY])
    field = np.subtract(bad.magnetometer(0, LEVEL).field, good.magnetometer(0, LEVEL).field)
    assert field == pytest.approx([1e-6 - 15e-6, 15e-6, 0.0])
    assert bad.pressure(0, 1.0).pressure - good.pressure(0, 1.0).pressure == pytest.approx(300.0)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("waves.height=5", "simulator.waves.period"),
        ("waves={height=4.0, period=3.0}", "breaks beyond 2.00 m, found 4 m"),
        ("waves={height=-1.0, period=3.0}", "height"),
        ("vibration.force=-1", "vibration.force"),
        ("sensor_errors.gyro_offset=[1,2]", "gyro_offset"),
        ("sensor_errors.accelerometer_scale=[0,1,1]", "accelerometer_scale"),
        ("hull.voltage_exponent=9", "voltage_exponent"),
        ("hull.gravity_shift=[1,0,0]", "gravity_shift"),
        ("imu_rate=1", "imu_rate"),
        ("mounting.imu.rotation=[[1,0,0],[1,0,0],[0,0,1]]", "rotation is no rotation"),
    ],
)
def test_a_bad_value_is_one_sentence(setting: str, words: str) -> None:
    with pytest.raises(LindyError) as told:
        Stack(overrides=[f"simulator.{setting}"]).section("simulator", Settings)
    assert words in str(told.value) or words.split(".")[-1] in str(told.value)
    assert "\n" not in str(told.value)
