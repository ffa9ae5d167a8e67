"""The wiring, in the virtual host, with a test that plays the sensors."""

import math
from dataclasses import dataclass, field

import pytest

from messages import topics
from messages.health import LogLine
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.state import VehicleState
from services.estimation.core import Settings
from services.marine.vehicle import GRAVITY, SEA_WATER, Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node

ROW = ServiceSpec(sides=["drone"])
QUICK = Stack(overrides=["estimation.calibration.still_time=3"])  # [s] less to wait for
S = 1_000_000_000  # [ns]
FLOATING = Stack().section("vehicle", Vehicle).floating_depth


@dataclass
class Bench:
    """A virtual host with the estimation service, and a node that plays the sensors."""

    host: VirtualHost = field(default_factory=VirtualHost)
    depth: float = FLOATING  # [m]
    yaw_rate: float = 0.0  # [rad/s]
    imu: bool = True
    heading: float = 1.0  # [rad]
    states: list[VehicleState] = field(default_factory=list[VehicleState])
    lines: list[LogLine] = field(default_factory=list[LogLine])

    def __post_init__(self) -> None:
        self.service = self.host.add("estimation", ROW, QUICK)
        vehicle = self.host.node("vehicle", ["drone"])
        self._play(vehicle)
        vehicle.each(topics.STATE, lambda state, _: self.states.append(state))
        vehicle.each(topics.LOG, lambda line, _: self.lines.append(line))

    def restart(self) -> None:
        self.host.kill("estimation")
        self.service = self.host.add("estimation", ROW, QUICK)

    def run(self, seconds: float) -> VehicleState:
        self.host.run(self.host.now + round(seconds * S))
        return self.states[-1]

    def _play(self, vehicle: Node) -> None:
        pressure = vehicle.publisher(topics.PRESSURE)
        imu = vehicle.publisher(topics.IMU)
        compass = vehicle.publisher(topics.MAGNETOMETER)

        def move(now: int) -> None:
            self.heading += self.yaw_rate / topics.IMU.hz
            down = 48e-6 + 1e-12 * (now % 7)
            north, east = 15e-6 * math.cos(self.heading), -15e-6 * math.sin(self.heading)
            compass.put(MagnetometerSample(stamp_ns=now, field=(north, east, down)))
            noise = 1e-6 if self.host.now % 20_000_000 else -1e-6  # a sensor never repeats itself
            rate, force = (0.0, 0.0, self.yaw_rate), (0.0, noise, -GRAVITY)
            if self.imu:
                imu.put(ImuSample(stamp_ns=now, specific_force=force, angular_rate=rate))

        def press(now: int) -> None:
            above = SEA_WATER * GRAVITY * self.depth
            noise = 0.01 * (now % 7)
            pressure.put(PressureSample(stamp_ns=now, pressure=100_000.0 + above + noise))

        vehicle.every(topics.PRESSURE.hz, press)
        vehicle.every(topics.IMU.hz, move)


def test_every_imu_sample_becomes_one_state_that_carries_its_stamp():
    bench = Bench()
    bench.run(5.0)
    stamps = [state.sensor_ns for state in bench.states]
    assert len(stamps) == 500
    assert stamps == [round(k * S / 100) for k in range(1, 501)]
    assert all(state.stamp_ns >= state.sensor_ns for state in bench.states)
    assert bench.states[0].phase == "calibrating"
    assert bench.states[-1].phase == "running"


def test_calibration_counts_down_and_is_told_in_one_line():
    bench = Bench()
    bench.run(6.0)
    assert [line.text for line in bench.lines] == [
        "calibrating: 3 s at rest to go",
        "calibrating: 1 s at rest to go",
        "calibrated: gyroscope bias +0.000, +0.000, +0.000 deg/s, atmosphere 1000.0 hPa",
    ]


def test_a_restart_in_mid_dive_keeps_depth_and_heading_and_does_not_calibrate():
    bench = Bench()
    bench.run(4.0)
    bench.depth, bench.yaw_rate = 12.0, 0.5
    bench.run(20.0)
    bench.yaw_rate = 0.0
    before = bench.run(2.0)
    bench.restart()
    seen = len(bench.states)
    after = bench.run(1.0)
    assert bench.states[seen].phase == "running"
    assert bench.states[seen].heading.value == pytest.approx(before.heading.value, abs=1e-6)
    assert before.heading.value > math.pi
    assert after.depth.valid
    assert after.depth.value == pytest.approx(12.0, abs=0.01)
    (said,) = [line.text for line in bench.lines if "goes on with the dive" in line.text]
    degrees = round(math.degrees(before.heading.value)) % 360  # it has turned more than once
    assert said.endswith(f", heading {degrees} deg from before the restart")


def test_a_silent_imu_gives_invalid_states_at_the_topics_rate_and_is_counted():
    bench = Bench()
    bench.run(5.0)
    bench.imu = False
    silent_from = len(bench.states)
    state = bench.run(2.0)
    assert not state.heading.valid
    assert state.depth.valid
    assert len(bench.states) - silent_from == pytest.approx(180, abs=2)
    assert bench.service.counts["predicted:state"] == len(bench.states) - silent_from
    assert bench.service.counts["silent:sensor/imu"] > 180
    bench.imu = True
    assert not bench.run(0.5).heading.valid, "until the compass has been measured for a second"
    assert bench.run(1.0).heading.valid


def test_before_the_first_imu_sample_nothing_is_said():
    bench = Bench(imu=False)
    bench.host.run(3 * S)
    assert bench.states == []


def test_the_vehicle_file_holds_valid_settings():
    assert isinstance(Stack().section("estimation", Settings), Settings)


def test_a_wrong_setting_is_one_sentence():
    with pytest.raises(LindyError, match="pressure_std"):
        Stack(overrides=["estimation.depth.pressure_std=-1"]).section("estimation", Settings)
