"""The rest before a dive: what is learnt, which wrong sensor keeps it from ending, and what happens
where there is no rest: in mid-dive, as a log begins, or on a boat that rocks."""

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Vec3
from messages.vehicle import Actuation
from services.estimation.rest import Rest
from services.estimation.settings import CalibrationSettings, Settings
from services.estimation.start import MOST_TILT, tilt, wrong_at_rest
from services.marine.attitude import from_euler, to_body
from services.marine.mounting import ImuMount, Mounting
from services.marine.vehicle import ATMOSPHERE, GRAVITY, Vehicle
from services.runtime.config.stack import Stack
from tests.services.estimation.sensed import AIR, EARTH, MS, Sensed
from tests.support.messages import example

QUICK = CalibrationSettings(still_time=1.5)  # [s] less to wait for

# [rad] a lean of the vehicle, to any side; a bias of 0.45 m/s² adds up to 2.6 deg to what is read.
lean = st.tuples(st.floats(0.0, math.radians(MOST_TILT - 3.0)), st.floats(-math.pi, math.pi))
bias = st.tuples(*[st.floats(-0.26, 0.26)] * 3)  # [m/s²] together 0.45 at most: inside the band
few = settings(max_examples=25, deadline=None)


def leaning(how: tuple[float, float]) -> Vec3:
    """[m/s²] Specific force of a vehicle that leans by an angle to any side, FRD."""
    angle, side = how
    level = math.sin(angle) * GRAVITY
    return level * math.cos(side), level * math.sin(side), -math.cos(angle) * GRAVITY


def bench(
    force: Vec3 = (0.0, 0.0, -GRAVITY), vehicle: Vehicle | None = None, *, compass: bool = False
) -> Sensed:
    """A vehicle at rest with sensors that may be wrong."""
    made = Sensed(Settings(calibration=QUICK), seed=1, vehicle=vehicle, compass=compass)
    made.gravity = force
    return made


def runs(bench: Sensed, seconds: float = 3.0) -> bool:
    seen = bench.go(seconds).states
    return bool(seen) and seen[-1][1].phase == "running"


# What is learnt.


def test_at_rest_the_bias_is_the_mean_rate_and_motion_begins_the_average_anew():
    rest, true = Rest(QUICK), np.array([0.01, -0.02, 0.03])
    rng = np.random.default_rng(0)

    def feed(seconds: float, yaw_rate: float = 0.0) -> int:
        """How often it began to move."""
        moved = 0
        for k in range(round(100 * seconds)):
            p, q, r = (true + (0.0, 0.0, yaw_rate) + 0.002 * rng.standard_normal(3)).tolist()
            a, b, c = (0.02 * rng.standard_normal(3)).tolist()
            rested = rest.unrest is None
            rest.imu((a, b, c - GRAVITY), (p, q, r), 0.01)
            moved += rested and rest.unrest is not None
            if k % 2:
                rest.pressure(101_325.0)
        return moved

    assert feed(1.0) == 0
    assert feed(1.0, yaw_rate=0.04) == 1  # a slow turn that begins after rest
    assert feed(5.0, yaw_rate=0.5) == 1
    feed(1.4)
    assert rest.result() is None
    feed(0.1)
    learnt = rest.result()
    assert learnt is not None
    assert learnt.gyro_bias == pytest.approx(true.tolist(), abs=6e-4)
    assert learnt.pressure == pytest.approx(101_325.0)
    assert learnt.field is None


def test_a_steady_turn_is_motion_although_nothing_varies():
    vehicle = bench()
    vehicle.turn = lambda _: 0.2
    assert not runs(vehicle, 10.0)
    assert vehicle.counts["moved:calibration"] == 1


# What may be.


@few
@given(lean, bias, st.floats(0.0, 0.15), st.floats(0.0, 0.4))
def test_any_lean_below_the_limit_with_any_bias_and_delay_in_the_band_is_calibrated(
    how: tuple[float, float], error: Vec3, age: float, pressure_age: float
):
    vehicle = bench(leaning(how), compass=True)
    vehicle.more["force"] = error
    vehicle.age = {"imu": age, "pressure": pressure_age}
    assert runs(vehicle)
    assert not vehicle.warnings


@few
@given(st.floats(0.5, 5.0), st.floats(1.0, 10.0))
def test_no_swell_reads_like_a_wrong_unit(amplitude: float, period: float):
    vehicle = bench()
    vehicle.acceleration = lambda t: amplitude * math.sin(2.0 * math.pi * t / period)
    vehicle.run(8.0)
    assert not [name for name in vehicle.counts if name.startswith("wrong_unit")]


def test_a_disturbed_compass_costs_the_compass_and_not_the_dive():
    vehicle = bench(compass=True)
    vehicle.earth = (400e-6, 0.0, 0.0)
    assert runs(vehicle)


# What may not.


@few
@given(lean, st.floats(-math.pi, math.pi))
def test_an_imu_upside_down_never_ends_the_calibration(how: tuple[float, float], about: float):
    x, y, z = leaning(how)
    c, s = math.cos(2.0 * about), math.sin(2.0 * about)  # half a turn about an axis in the plane
    vehicle = bench((c * x + s * y, s * x - c * y, -z))
    assert not runs(vehicle, 5.0)
    assert set(vehicle.counts) <= {"upside_down:sensor/imu", "on_its_side:sensor/imu"}
    assert len(vehicle.counts) == 1


def test_a_mounting_in_the_vehicle_file_that_is_untrue_by_half_a_turn_is_found():
    turned = ImuMount(rotation=((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)))
    pioneer = Stack().section("vehicle", Vehicle)
    told = msgspec.structs.replace(pioneer, mounting=Mounting(imu=turned))
    vehicle = bench(vehicle=told)
    assert not runs(vehicle, 6.0)
    assert vehicle.counts["upside_down:sensor/imu"] == 1
    (warning,) = vehicle.warnings
    assert "[vehicle.mounting.imu]" in warning
    assert "+9.8 m/s²" in warning
    assert runs(bench((0.0, 0.0, GRAVITY), told))  # when it is true


@few
@given(lean, st.sampled_from([1.0 / 9.81, 9.81, 0.001, 1000.0, 3.28]), st.floats(-0.5, 0.5))
def test_no_wrong_unit_of_the_accelerometer_ends_the_calibration(
    how: tuple[float, float], factor: float, more: float
):
    vehicle = bench(leaning(how))
    vehicle.more["force"], vehicle.factor["force"] = (0.0, 0.0, more), factor
    assert not runs(vehicle, 5.0)
    assert vehicle.counts["wrong_unit:sensor/imu"] == 1
    (warning,) = vehicle.warnings
    assert "m/s²" in warning


@few
@given(st.floats(0.6, 6.0), st.sampled_from([-1.0, 1.0]), lean)
def test_no_force_beyond_the_band_ends_the_calibration(
    more: float, sign: float, how: tuple[float, float]
):
    k = 1.0 + sign * more / GRAVITY
    x, y, z = leaning(how)
    vehicle = bench((k * x, k * y, k * z))
    assert not runs(vehicle, 5.0)
    assert vehicle.counts["wrong_force:sensor/imu"] == 1


@few
@given(st.floats(0.25, 1e6), st.floats(0.55, 1e6))
def test_no_old_stamps_of_the_imu_or_the_pressure_end_the_calibration(imu: float, pressure: float):
    for sensor, age, allowed in (("imu", imu, "0.2 s"), ("pressure", pressure, "0.5 s")):
        vehicle = bench()
        vehicle.age[sensor] = age
        assert not runs(vehicle, 4.0)
        assert vehicle.counts[f"old_stamps:sensor/{sensor}"] == 1
        (warning,) = vehicle.warnings
        assert f"allowed are {allowed}" in warning


@few
@given(st.sampled_from([1e4, 1e6, 1e9, 1e7, 1e-3]))
def test_no_wrong_unit_of_the_magnetometer_ends_the_calibration(factor: float):
    vehicle = bench(compass=True)
    vehicle.factor["field"] = factor
    assert not runs(vehicle, 5.0)
    assert vehicle.counts["wrong_unit:sensor/magnetometer"] == 1
    vehicle.absent.add("magnetometer")  # it is no longer what the verdict was about
    assert runs(vehicle, 6.0)


@pytest.mark.parametrize(("factor", "read"), [(0.01, "reads 102"), (1e-5, "reads 1.02")])
def test_pressure_in_mbar_or_bar_is_named(factor: float, read: str):
    vehicle = bench()
    vehicle.factor["pressure"] = factor
    assert not runs(vehicle, 5.0)
    (warning,) = vehicle.warnings
    assert read in warning
    assert "absolute pressure in Pa" in warning


def test_rates_in_degrees_are_named_when_they_never_come_to_rest():
    vehicle = bench()
    vehicle.more["rate"], vehicle.factor["rate"] = (0.01, 0.01, 0.01), 57.3
    assert not runs(vehicle, 20.0)
    assert vehicle.counts["moving:calibration"] == 1
    assert "rad/s, not deg/s" in vehicle.warnings[-1]


def test_an_imu_without_usable_samples_is_named_once_with_what_was_refused():
    vehicle = bench()
    vehicle.counts["from_future:sensor/imu"] = 500
    vehicle.absent = {"imu", "pressure", "magnetometer"}
    assert not vehicle.go(20.0).states
    assert vehicle.counts["unusable:sensor/imu"] == 1
    ((_, text, _),) = vehicle.estimator.outbox.said
    assert "time stamp in the future (sensor/imu), 500 times" in text


def test_a_pressure_sensor_that_boots_late_is_waited_for_and_said() -> None:
    vehicle = Sensed()
    vehicle.absent = {"pressure"}
    assert not runs(vehicle, 8.0)
    assert vehicle.counts["waiting:sensor/pressure"] == 1
    assert "pressure" in vehicle.estimator.outbox.said[-1][1]
    vehicle.absent = set()
    assert runs(vehicle, 2.0)


def test_a_magnetometer_beside_steel_from_the_start_is_said_and_gives_no_north() -> None:
    vehicle = Sensed()
    vehicle.earth = (60e-6, 10e-6, 60e-6)
    state = vehicle.run(5.0)
    assert state.phase == "running"
    assert vehicle.counts["disturbed:sensor/magnetometer"] == 1
    assert any("not the Earth's" in text for _, text, _ in vehicle.estimator.outbox.said)
    assert state.heading_navigation is None
    assert state.heading.valid
    vehicle.earth = EARTH
    assert vehicle.run(4.0).heading_navigation is not None


# What the pilot gets to know, and when it ends.


def test_the_state_says_what_blocks_it_for_as_long_as_it_does_and_the_rest_starts_anew():
    vehicle = bench()
    vehicle.factor["force"] = 1.0 / 9.81
    assert not any(runs(vehicle, 1.0) for _ in range(10))
    state = vehicle.states[-1][1]
    assert state.blocked_by == "wrong_unit:sensor/imu"
    assert state.calibration_left is None
    assert not state.heading.valid
    assert vehicle.counts == {"wrong_unit:sensor/imu": 1}
    assert len(vehicle.warnings) == 1
    vehicle.factor.clear()
    assert not runs(vehicle, 1.4)
    state = vehicle.run(2.0)  # up to a second until it is seen, and a rest of 1.5 s
    assert state.phase == "running"
    assert not state.blocked_by
    assert b"blocked_by" not in msgspec.msgpack.encode(state)


# The pure laws.

angle = st.floats(-math.pi, math.pi)


@given(angle, st.floats(-1.5, 1.5), st.floats(9.4, 10.2))
def test_the_verdict_on_the_direction_is_that_of_the_tilt(roll: float, pitch: float, size: float):
    force = to_body(from_euler(roll, pitch, 0.0), (0.0, 0.0, -size))
    true = math.degrees(math.acos(max(-1.0, min(1.0, math.cos(roll) * math.cos(pitch)))))
    assert tilt(force) == pytest.approx(true, abs=1e-4)
    assert (wrong_at_rest(force, 0.5) is None) == (tilt(force) <= MOST_TILT)


@given(st.tuples(*[st.floats(-1e3, 1e3)] * 3), st.floats(0.01, 10.0))
def test_whatever_is_read_a_verdict_is_one_sentence(force: Vec3, tolerance: float):
    found = wrong_at_rest(force, tolerance)
    if abs(math.hypot(*force) - GRAVITY) > tolerance:
        assert found is not None
    if found is not None:
        assert "\n" not in found.sentence
        assert found.name.endswith(":sensor/imu")


# Without a rest.

BIAS = (0.02, -0.06, 0.01)  # [rad/s] of a gyroscope as it comes
DEPTH = 2.0  # [m]
ROUGH = "rough:calibration"


def rocking(settings: Settings | None = None, *, compass: bool = False) -> Sensed:
    vehicle = Sensed(settings or Settings(), seed=4, compass=compass)
    vehicle.noise = {"force": 0.02, "rate": 1e-3, "pressure": 40.0, "field": 0.0}
    vehicle.every["pressure"] = 50
    vehicle.rolls, vehicle.more["rate"] = 0.3, BIAS
    vehicle.depth = lambda _: DEPTH
    vehicle.more["pressure"] = (ATMOSPHERE - AIR,)
    return vehicle


def test_it_begins_within_some_seconds_learns_the_bias_from_gravity_and_the_rest_at_the_first():
    vehicle = rocking()
    state = vehicle.run(20.42)  # level
    assert min(t for t, s in vehicle.states if s.phase == "running") < 6.0
    assert ROUGH in (state.troubles or ())
    assert state.roll.valid
    assert state.depth.valid
    assert state.roll.value == pytest.approx(vehicle.roll, abs=0.02)
    assert abs(state.pitch.value) < 0.02
    assert state.depth.value == pytest.approx(DEPTH, abs=3.0 * state.depth.std)
    assert vehicle.counts["inconsistent:sensor/imu"] == 0
    vehicle.rolls = 0.0
    state = vehicle.run(12.0)
    assert ROUGH not in (state.troubles or ())
    assert vehicle.checkpoint.gyro_bias == pytest.approx(BIAS, abs=1e-3)
    assert vehicle.run(20.0).heading.std < state.heading.std + 0.01


def test_a_heading_that_thrusters_hold_is_no_rest():
    """By a wrong bias it is held so that the gyroscope reads just that."""
    vehicle = rocking()
    vehicle.run(20.42)  # level
    vehicle.rolls = 0.0
    state = vehicle.run(0.1)
    for _ in range(120):
        at = vehicle.ms * MS
        vehicle.estimator.actuation(example(Actuation, at, thrust=(3.0, -3.0), measured=True))
        state = vehicle.run(0.1)
    assert ROUGH in (state.troubles or ())
    assert ROUGH not in (vehicle.run(12.0).troubles or ())


def test_a_compass_shows_the_bias_about_the_vertical():
    vehicle = rocking(compass=True)
    before = vehicle.run(40.0).heading.value
    assert vehicle.run(15.0).heading.value == pytest.approx(before, abs=0.03)  # 0.15 by the bias


def test_a_pressure_of_the_air_that_the_file_gives_makes_the_depth_known():
    given = Settings(calibration=CalibrationSettings(atmosphere=ATMOSPHERE))
    state = rocking(given).run(20.0)
    assert state.depth.std < 0.05
    assert state.depth.value == pytest.approx(DEPTH, abs=0.05)


def test_a_gyroscope_in_the_wrong_unit_does_not_begin_a_dive():
    vehicle = rocking()
    vehicle.factor["rate"] = 57.3
    assert not runs(vehicle, 20.0)
