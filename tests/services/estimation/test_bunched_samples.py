"""IMU samples that pile up while the service does not run: every one is used."""

from collections import Counter
from collections.abc import Sequence
from math import cos, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.sensors import ImuSample, PressureSample
from messages.state import VehicleState
from services.marine.vehicle import GRAVITY
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node

ROW = ServiceSpec(sides=["drone"])
QUICK = Stack(overrides=["estimation.calibration.still_time=3"])  # [s] less to wait for
PERIOD = 10_000_000  # [ns]
CALIBRATED, TURNED = 320, 520  # IMU samples until it is calibrated, and until the end


def imu(k: int) -> ImuSample:
    """At rest, then rolling, pitching and turning, faster and slower."""
    t = max(0, k - CALIBRATED) / 100
    rate = 0.3 * sin(7.0 * t), 0.2 * sin(5.0 * t), 0.8 * sin(t)
    noise = 1e-6 * (-1) ** k  # a sensor never repeats itself
    force = (GRAVITY * 0.03 * sin(t), noise, -GRAVITY * cos(0.03 * sin(t)))
    return ImuSample(stamp_ns=k * PERIOD, specific_force=force, angular_rate=rate)


def gauge(k: int) -> PressureSample:
    return PressureSample(stamp_ns=k * PERIOD, pressure=101_700.0 + 0.01 * (k % 7))


class Bench:
    """The estimation service, stepped when the test says so."""

    def __init__(self) -> None:
        self.host, self.states = VirtualHost(), list[VehicleState]()
        self.service: Node = self.host.add("estimation", ROW, QUICK)
        port = self.host.node("ear", ["drone"])
        port.each(topics.STATE, lambda m, _: self.states.append(m))
        self.imu = self.host.node("vehicle", ["drone"]).publisher(topics.IMU)
        self.pressure = self.host.node("gauge", ["drone"]).publisher(topics.PRESSURE)
        self.port, self.k = port, 0

    def take(self, bunch: int) -> None:
        """So many samples arrive before the service runs."""
        for _ in range(bunch):
            self.k += 1
            self.host.now = self.k * PERIOD
            self.imu.put(imu(self.k))
            if self.k <= CALIBRATED and self.k % 2:
                self.pressure.put(gauge(self.k))
        self.service.step()
        self.port.step()


def flown(bunches: Sequence[int]) -> tuple[VehicleState, Counter[str], int]:
    """The last state, what was counted, and how many states were said."""
    bench = Bench()
    for _ in range(CALIBRATED):
        bench.take(1)
    for bunch in bunches:
        bench.take(min(bunch, TURNED - 1 - bench.k))
        if bench.k == TURNED - 1:
            break
    bench.take(TURNED - bench.k)
    return bench.states[-1], bench.service.counts, len(bench.states)


@pytest.fixture(scope="module")
def one_by_one() -> VehicleState:
    return flown([1] * TURNED)[0]


@settings(max_examples=10, deadline=None)
@given(bunches=st.lists(st.integers(1, 60), min_size=1, max_size=40))
def test_however_they_are_bunched_the_attitude_is_the_same(
    bunches: list[int], one_by_one: VehicleState
) -> None:
    last, counts, _ = flown(bunches)
    assert last.sensor_ns == one_by_one.sensor_ns
    assert last.attitude == pytest.approx(one_by_one.attitude, abs=1e-9)
    assert last.heading.value == pytest.approx(one_by_one.heading.value, abs=1e-9)
    assert last.yaw_rate.value == pytest.approx(one_by_one.yaw_rate.value, abs=1e-9)
    assert abs(last.heading.value) > 0.1
    assert last.phase == "running"
    lost = ("overflowed", "lost", "skipped", "gap", "rate")
    there = [name for name in counts if name != "unusable:sensor/pressure"]  # it has none
    assert not [name for name in there if name.startswith(lost)]


def test_a_bunch_is_answered_with_one_state() -> None:
    states = [flown([bunch] * TURNED)[2] for bunch in (1, 10)]
    assert states[0] == TURNED
    assert states[1] == pytest.approx(CALIBRATED + (TURNED - CALIBRATED) / 10, abs=2)
