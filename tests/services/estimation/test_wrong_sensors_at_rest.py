"""A sensor that cannot be right keeps the calibration from ending; one that can never does."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.state import VehicleState
from messages.units import Vec3
from services.estimation.core import Estimator
from services.estimation.first_samples import MOST_TILT, tilt, wrong_at_rest
from services.estimation.settings import CalibrationSettings, Settings
from services.marine.attitude import from_euler, to_body
from services.marine.mounting import ImuMount, Mounting
from services.marine.vehicle import GRAVITY, Vehicle
from services.runtime.config.stack import Stack

QUICK = Settings(calibration=CalibrationSettings(still_time=1.5))  # [s] less to wait for
MS, S = 1_000_000, 1_000_000_000  # [ns]
AIR = 100_900.0  # [Pa]
EARTH: Vec3 = (15e-6, 0.0, 49e-6)  # [T]
UP: Vec3 = (0.0, 0.0, -GRAVITY)  # [m/s²]
Scaled = Callable[[float], float]

# [rad] a lean of the vehicle, to any side; a bias of 0.45 m/s² adds up to 2.6 deg to what is read.
lean = st.tuples(st.floats(0.0, math.radians(MOST_TILT - 3.0)), st.floats(-math.pi, math.pi))
bias = st.tuples(*[st.floats(-0.26, 0.26)] * 3)  # [m/s²] together 0.45 at most: inside the band
few = settings(max_examples=25, deadline=None)


def leaning(how: tuple[float, float]) -> Vec3:
    """[m/s²] Specific force of a vehicle that leans by an angle to any side, FRD."""
    angle, side = how
    level = math.sin(angle) * GRAVITY
    return level * math.cos(side), level * math.sin(side), -math.cos(angle) * GRAVITY


@dataclass
class Bench:
    """An estimator before a dive, and a vehicle at rest with sensors that may be wrong."""

    vehicle: Vehicle | None = None
    force: Vec3 = UP
    factor: float = 1.0  # [-] of the accelerometer's unit
    gyro_factor: float = 1.0
    age: float = 0.0  # [s] of the IMU's stamps
    pressure_age: float = 0.0  # [s]
    pressure_factor: float = 1.0
    magnet: Vec3 | None = None
    shaken: Scaled = lambda _: 0.0  # [m/s²] along down, of seconds
    ms: int = 0
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(1))

    def __post_init__(self) -> None:
        self.outbox = Outbox()
        self.refused = self.outbox.counts
        self.estimator = Estimator(QUICK, 0.2, None, self.vehicle, self.outbox)

    def run(self, seconds: float) -> VehicleState | None:
        """The newest state."""
        state: VehicleState | None = None
        for _ in range(round(seconds * 100)):
            self.ms += 10
            if self.ms % 20 == 0:
                self._press()
            if self.magnet is not None:
                x, y, z = (b + 1e-3 * b * self.rng.standard_normal() for b in self.magnet)
                sample = MagnetometerSample(stamp_ns=self.ms * MS, field=(x, y, z))
                self.estimator.magnetometer(sample)
            state = self.estimator.imu(self._feel(), self.ms * MS)
        return state

    def _press(self) -> None:
        stamp = self.ms * MS - round(self.pressure_age * S)
        pressure = self.pressure_factor * (AIR + 100.0 * self.rng.standard_normal())
        self.estimator.pressure(PressureSample(stamp_ns=stamp, pressure=pressure))

    def _feel(self) -> ImuSample:
        x, y, z = (f + 0.015 * self.rng.standard_normal() for f in self.force)
        z += self.shaken(self.ms / 1e3)
        k, g = self.factor, self.gyro_factor
        p, q, r = (g * (0.01 + 0.001 * self.rng.standard_normal()) for _ in range(3))
        return ImuSample(
            stamp_ns=self.ms * MS - round(self.age * S),
            specific_force=(k * x, k * y, k * z),
            angular_rate=(p, q, r),
        )

    @property
    def warnings(self) -> list[str]:
        return [text for level, text, _ in self.outbox.said if level == "warning"]


def runs(bench: Bench, seconds: float = 3.0) -> bool:
    state = bench.run(seconds)
    return state is not None and state.phase == "running"


# What may be.


@few
@given(lean, bias, st.floats(0.0, 0.15), st.floats(0.0, 0.4))
def test_any_lean_below_the_limit_with_any_bias_and_delay_in_the_band_is_calibrated(
    how: tuple[float, float], error: Vec3, age: float, pressure_age: float
):
    (x, y, z), (a, b, c) = leaning(how), error
    bench = Bench(force=(x + a, y + b, z + c), age=age, pressure_age=pressure_age, magnet=EARTH)
    assert runs(bench)
    assert not bench.warnings


@few
@given(st.floats(0.5, 5.0), st.floats(1.0, 10.0))
def test_no_swell_reads_like_a_wrong_unit(amplitude: float, period: float):
    bench = Bench(shaken=lambda t: amplitude * math.sin(2.0 * math.pi * t / period))
    bench.run(12.0)
    assert not [name for name in bench.refused if name.startswith("wrong_unit")]


def test_a_disturbed_compass_costs_the_compass_and_not_the_dive():
    assert runs(Bench(magnet=(400e-6, 0.0, 0.0)))


# What may not.


@few
@given(lean, st.floats(-math.pi, math.pi))
def test_an_imu_upside_down_never_ends_the_calibration(how: tuple[float, float], about: float):
    x, y, z = leaning(how)
    c, s = math.cos(2.0 * about), math.sin(2.0 * about)  # half a turn about an axis in the plane
    bench = Bench(force=(c * x + s * y, s * x - c * y, -z))
    assert not runs(bench, 6.0)
    assert set(bench.refused) <= {"upside_down:sensor/imu", "on_its_side:sensor/imu"}
    assert len(bench.refused) == 1


def test_a_mounting_in_the_vehicle_file_that_is_untrue_by_half_a_turn_is_found():
    vehicle = Stack().section("vehicle", Vehicle)
    turned = ImuMount(rotation=((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)))
    told = msgspec.structs.replace(vehicle, mounting=Mounting(imu=turned))
    bench = Bench(vehicle=told)
    assert not runs(bench, 6.0)
    assert bench.refused["upside_down:sensor/imu"] == 1
    (warning,) = bench.warnings
    assert "[vehicle.mounting.imu]" in warning
    assert "+9.8 m/s²" in warning
    assert runs(Bench(vehicle=told, force=(0.0, 0.0, GRAVITY)))  # when it is true


@few
@given(lean, st.sampled_from([1.0 / 9.81, 9.81, 0.001, 1000.0, 3.28]), st.floats(-0.5, 0.5))
def test_no_wrong_unit_of_the_accelerometer_ends_the_calibration(
    how: tuple[float, float], factor: float, more: float
):
    x, y, z = leaning(how)
    bench = Bench(force=(x, y, z + more), factor=factor)
    assert not runs(bench, 6.0)
    assert bench.refused["wrong_unit:sensor/imu"] == 1
    (warning,) = bench.warnings
    assert "m/s²" in warning


@few
@given(st.floats(0.6, 6.0), st.sampled_from([-1.0, 1.0]), lean)
def test_no_force_beyond_the_band_ends_the_calibration(
    more: float, sign: float, how: tuple[float, float]
):
    k = 1.0 + sign * more / GRAVITY
    x, y, z = leaning(how)
    bench = Bench(force=(k * x, k * y, k * z))
    assert not runs(bench, 5.0)
    assert bench.refused["wrong_force:sensor/imu"] == 1


@few
@given(st.floats(0.25, 1e6))
def test_no_old_stamps_of_the_imu_end_the_calibration(age: float):
    bench = Bench(age=age)
    assert not runs(bench, 5.0)
    assert bench.refused["old_stamps:sensor/imu"] == 1
    (warning,) = bench.warnings
    assert "allowed are 0.2 s" in warning


@few
@given(st.floats(0.55, 1e6))
def test_no_old_stamps_of_the_pressure_end_the_calibration(age: float):
    bench = Bench(pressure_age=age)
    assert not runs(bench, 5.0)
    assert bench.refused["old_stamps:sensor/pressure"] == 1


@few
@given(st.sampled_from([1e4, 1e6, 1e9, 1e7, 1e-3]))
def test_no_wrong_unit_of_the_magnetometer_ends_the_calibration(factor: float):
    x, y, z = EARTH
    bench = Bench(magnet=(factor * x, factor * y, factor * z))
    assert not runs(bench, 5.0)
    assert bench.refused["wrong_unit:sensor/magnetometer"] == 1
    bench.magnet = None  # taken away: it is no longer what the verdict was about
    assert runs(bench, 6.0)


@pytest.mark.parametrize(("factor", "read"), [(0.01, "reads 1009 Pa"), (1e-5, "reads 1.009 Pa")])
def test_pressure_in_mbar_or_bar_is_named(factor: float, read: str):
    bench = Bench(pressure_factor=factor)
    assert not runs(bench, 5.0)
    (warning,) = bench.warnings
    assert read in warning
    assert "absolute pressure in Pa" in warning


def test_rates_in_degrees_are_named_when_they_never_come_to_rest():
    bench = Bench(gyro_factor=57.3)
    assert not runs(bench, 20.0)
    assert bench.refused["moving:calibration"] == 1
    assert "rad/s, not deg/s" in bench.warnings[-1]


def test_an_imu_without_usable_samples_is_named_once_with_what_was_refused():
    bench = Bench()
    bench.refused["from_future:sensor/imu"] = 500
    for ms in range(10, 20_000, 10):
        assert bench.estimator.silence(ms * MS) is None
    assert bench.refused["unusable:sensor/imu"] == 1
    ((_, text, _),) = bench.outbox.said
    assert "time stamp in the future (sensor/imu), 500 times" in text


# What the pilot gets to know, and when it ends.


def test_the_state_says_what_blocks_it_for_as_long_as_it_does():
    bench = Bench(factor=1.0 / 9.81)
    state = bench.run(3.0)
    assert state is not None
    assert state.blocked_by == "wrong_unit:sensor/imu"
    assert state.calibration_left is None
    assert not state.heading.valid
    bench.factor = 1.0
    state = bench.run(3.4)  # up to a second until it is seen, and a rest of 1.5 s
    assert state is not None
    assert state.phase == "running"
    assert not state.blocked_by
    assert b"blocked_by" not in msgspec.msgpack.encode(state)


def test_once_it_is_right_the_rest_starts_anew():
    bench = Bench(force=(0.0, 0.0, GRAVITY))
    assert not runs(bench, 4.0)
    bench.force = UP
    assert not runs(bench, 1.4)
    assert runs(bench, 1.2)
    assert bench.refused["upside_down:sensor/imu"] == 1


def test_a_minute_of_wrong_samples_is_one_count_and_one_warning():
    bench = Bench(force=(0.0, 0.0, GRAVITY))
    bench.run(60.0)
    assert bench.refused == {"upside_down:sensor/imu": 1}
    assert len(bench.warnings) == 1


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
