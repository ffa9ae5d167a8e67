"""The service on the virtual host: its wiring, samples that pile up, and every way in which a
sensor can be bad, from its bytes to `health` and `state`."""

from collections import Counter
from collections.abc import Callable, Sequence
from math import cos, degrees, nan, pi, sin
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.health import Health, LogLine
from messages.message import Message
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.state import VehicleState
from messages.topic import Topic
from services.marine.vehicle import GRAVITY, SEA_WATER, Vehicle
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node

ROW = ServiceSpec(sides=["drone"])
QUICK = Stack(overrides=["estimation.calibration.still_time=3"])  # [s] less to wait for
S = 1_000_000_000  # [ns]
FLOATING = QUICK.section("vehicle", Vehicle).floating_depth
SENSORS = {"pressure": topics.PRESSURE, "magnetometer": topics.MAGNETOMETER, "imu": topics.IMU}
Fields = dict[str, Any]  # of a message, by name
Fault = Callable[[Fields, Fields], list[Fields]]  # sample, the one when the fault began → said


class Bench:
    """A vehicle at rest at the surface, whose sensors speak raw bytes to the service."""

    def __init__(self) -> None:
        self.host, self.rng = VirtualHost(), np.random.default_rng(0)
        self.service = self.host.add("estimation", ROW, QUICK)
        self.depth, self.heading, self.yaw_rate = FLOATING, 0.0, 0.0  # [m], [rad], [rad/s]
        self.fault, self.first = dict[str, Fault](), dict[str, Fields]()
        self.states, self.health, self.lines = list[VehicleState](), list[Health](), list[LogLine]()
        vehicle = self.host.node("vehicle", ["drone"])
        vehicle.each(topics.STATE, lambda state, _: self.states.append(state))
        vehicle.each(topics.LOG, lambda line, _: self.lines.append(line))
        vehicle.each(topics.HEALTH.of("estimation"), lambda health, _: self.health.append(health))
        for sensor, topic in SENSORS.items():
            self._play(vehicle, sensor, topic)

    def _play(self, vehicle: Node, sensor: str, topic: Topic[Any]) -> None:
        say, count = self.host.side("drone").say(topic), iter(range(10**9))

        def speak(now: int) -> None:
            sample = msgspec.to_builtins(self._measured(sensor, now)) | {"seq": next(count)}
            said = [sample]
            if (fault := self.fault.get(sensor)) is not None:
                said = fault(sample, self.first.setdefault(sensor, sample))
            for each in said:
                say(msgspec.msgpack.encode(each))

        vehicle.every(topic.hz, speak)

    def _measured(self, sensor: str, now: int) -> Message:
        a, b, c, p, q, r = (float(x) for x in self.rng.standard_normal(6))
        if sensor == "pressure":
            above = SEA_WATER * GRAVITY * self.depth
            return PressureSample(stamp_ns=now, pressure=101_000.0 + above + 300.0 * a)
        if sensor == "magnetometer":
            north, east = 15e-6 * cos(self.heading), -15e-6 * sin(self.heading)
            field = (north + 2e-7 * a, east + 2e-7 * b, 49e-6 + 2e-7 * c)
            return MagnetometerSample(stamp_ns=now, field=field)
        self.heading += self.yaw_rate / topics.IMU.hz
        force = (0.02 * a, 0.02 * b, 0.02 * c - GRAVITY)
        rate = (1e-3 * p, 1e-3 * q, 1e-3 * r + self.yaw_rate)
        return ImuSample(stamp_ns=now, specific_force=force, angular_rate=rate)

    def run(self, seconds: float) -> VehicleState:
        self.host.run(self.host.now + round(seconds * S))
        return self.states[-1]

    def count(self, name: str) -> int:
        """As `health/estimation` says, a second later at most."""
        self.run(1.1)
        return self.health[-1].counts.get(name, 0)


def test_every_imu_sample_becomes_one_state_that_carries_its_stamp_and_calibration_is_told() -> (
    None
):
    bench = Bench()
    bench.run(6.0)
    assert [state.sensor_ns for state in bench.states] == [k * S // 100 for k in range(1, 601)]
    assert all(state.stamp_ns >= state.sensor_ns for state in bench.states)
    assert bench.states[0].phase == "calibrating"
    assert bench.states[-1].phase == "running"
    first, second, last = (line.text for line in bench.lines)
    assert first == "calibrating: 3 s at rest to go"
    assert second == "calibrating: 1 s at rest to go"
    assert last.startswith("calibrated: gyroscope bias ")
    assert last.endswith(" hPa")


def test_a_restart_in_mid_dive_keeps_depth_and_heading_and_does_not_calibrate() -> None:
    bench = Bench()
    bench.run(4.0)
    bench.depth, bench.yaw_rate = 12.0, 0.5
    bench.run(14.0)
    bench.yaw_rate = 0.0
    before, seen = bench.run(6.0), len(bench.states)
    bench.host.kill("estimation")
    bench.service = bench.host.add("estimation", ROW, QUICK)
    after = bench.run(1.0)
    assert bench.states[seen].phase == "running"
    assert bench.states[seen].heading.value == pytest.approx(before.heading.value, abs=1e-3)
    assert before.heading.value > 2.0 * pi
    assert after.depth.valid
    assert after.depth.value == pytest.approx(12.0, abs=0.1)
    (said,) = [line.text for line in bench.lines if "goes on with the dive" in line.text]
    turned = round(degrees(before.heading.value)) % 360  # it has turned more than once
    assert said.endswith(f", heading {turned} deg from before the restart")


def test_a_silent_imu_gives_invalid_states_at_the_topics_rate_and_is_counted() -> None:
    bench = Bench()
    bench.run(5.0)
    bench.fault["imu"] = silent
    silent_from = len(bench.states)
    state = bench.run(2.0)
    assert not state.heading.valid
    assert state.depth.valid
    assert len(bench.states) - silent_from == pytest.approx(180, abs=2)
    assert bench.service.counts["predicted:state"] == len(bench.states) - silent_from
    assert bench.service.counts["silent:sensor/imu"] > 180
    del bench.fault["imu"]
    assert not bench.run(0.5).heading.valid, "until the compass has been measured for a second"
    assert bench.run(1.0).heading.valid


# Every way in which a sensor can be bad, as a table.


def vectors(sample: Fields) -> list[str]:
    return [name for name in sample if name in ("specific_force", "angular_rate", "field")]


def not_a_number(sample: Fields, _: Fields) -> list[Fields]:
    worst = {name: [0.0, nan, 0.0] for name in vectors(sample)} or {"pressure": nan}
    return [sample | worst]


def missing_axis(sample: Fields, _: Fields) -> list[Fields]:
    if not (short := {name: sample[name][:2] for name in vectors(sample)}):
        return [{name: value for name, value in sample.items() if name != "pressure"}]
    return [sample | short]


def frozen(sample: Fields, first: Fields) -> list[Fields]:
    return [first | {"stamp_ns": sample["stamp_ns"], "seq": sample["seq"]}]


def saturated(sample: Fields, _: Fields) -> list[Fields]:
    if "field" in sample:
        return [sample | {"field": [1e-4, 1e-4, 1e-4]}]
    return [sample | ({"angular_rate": [0.0, 0.0, 34.9]} if vectors(sample) else {"pressure": 2e7})]


def backwards(sample: Fields, first: Fields) -> list[Fields]:
    return [sample | {"stamp_ns": max(0, 2 * first["stamp_ns"] - sample["stamp_ns"] - S)}]


def duplicated(sample: Fields, _: Fields) -> list[Fields]:
    return [sample, sample]


def half_the_rate(sample: Fields, _: Fields) -> list[Fields]:
    return [sample] if sample["seq"] % 2 == 0 else []


def silent(_: Fields, __: Fields) -> list[Fields]:
    return []


def beside_steel(sample: Fields, _: Fields) -> list[Fields]:
    x, y, z = sample["field"]
    return [sample | {"field": [x + 3e-5, y + 2e-5, z]}]


# What the state says of it, beside the last state before it.


def gone_with_the_imu(before: VehicleState, state: VehicleState) -> None:
    assert state.sensor_ns <= before.sensor_ns + S
    gone = (state.roll, state.pitch, state.heading, state.yaw_rate, state.depth_acceleration)
    assert not any(part.valid for part in gone)
    assert state.depth.valid  # goes on from pressure alone
    assert state.depth_rate.std > 3.0 * before.depth_rate.std


def gone_with_the_pressure(before: VehicleState, state: VehicleState) -> None:
    assert not state.depth.valid
    rate = state.depth_rate  # goes on from the accelerometer alone
    assert rate.valid
    assert abs(rate.value) < 4.0 * rate.std
    assert rate.std > before.depth_rate.std
    assert state.heading.valid


def north_goes_on(_: VehicleState, state: VehicleState) -> None:
    assert state.heading_navigation is not None
    assert state.heading_navigation.valid  # by the gyroscope
    assert state.heading_navigation.value == pytest.approx(0.0, abs=0.05)
    assert state.heading.valid
    assert any(name.endswith(":sensor/magnetometer") for name in state.troubles or ())


def heading_is_known_less(before: VehicleState, state: VehicleState) -> None:
    assert state.heading.std > before.heading.std
    assert state.heading.valid


def depth_is_known_less(before: VehicleState, state: VehicleState) -> None:
    assert state.depth.std > 1.05 * before.depth.std
    assert state.depth.valid


def as_good_as_before(before: VehicleState, state: VehicleState) -> None:
    for part, other in ((state.depth, before.depth), (state.heading, before.heading)):
        assert part.valid
        assert part.value == pytest.approx(other.value, abs=4.0 * part.std + 0.002)
    assert state.depth.std < 1.05 * before.depth.std


Says = Callable[[VehicleState, VehicleState], None]
GONE: dict[str, tuple[float, Says]] = {
    "imu": (1.0, gone_with_the_imu),
    "pressure": (3.0, gone_with_the_pressure),
    "magnetometer": (5.0, north_goes_on),
}
SAME: tuple[float, Says] = (5.0, as_good_as_before)
# fault, sensor, what is counted [name before the colon], after [s], the state then
TABLE: list[tuple[Fault, str, str, float, Says]] = [
    *((not_a_number, sensor, "malformed", *GONE[sensor]) for sensor in SENSORS),
    *((missing_axis, sensor, "malformed", *GONE[sensor]) for sensor in SENSORS),
    (frozen, "imu", "frozen", *GONE["imu"]),
    (frozen, "pressure", "frozen", 3.0, gone_with_the_pressure),
    (frozen, "magnetometer", "frozen", *GONE["magnetometer"]),
    (saturated, "imu", "saturated", *GONE["imu"]),
    (saturated, "pressure", "implausible", *GONE["pressure"]),
    (saturated, "magnetometer", "implausible", *GONE["magnetometer"]),
    *((backwards, sensor, "reordered", *GONE[sensor]) for sensor in SENSORS),
    *((duplicated, sensor, "duplicated", *SAME) for sensor in SENSORS),
    (half_the_rate, "imu", "rate", 8.0, heading_is_known_less),
    (half_the_rate, "pressure", "rate", 8.0, depth_is_known_less),
    (half_the_rate, "magnetometer", "rate", *SAME),  # iron limits a compass, not noise
    (beside_steel, "magnetometer", "disturbed", *GONE["magnetometer"]),
    (silent, "imu", "silent", *GONE["imu"]),
    (silent, "pressure", "lost", 11.0, gone_with_the_pressure),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "sensor", "reason", "seconds", "says"),
    TABLE,
    ids=lambda value: getattr(value, "__name__", str(value)),
)
def test_a_bad_sensor_is_counted_by_name_and_the_state_says_what_is_left(
    fault: Fault,
    sensor: str,
    reason: str,
    seconds: float,
    says: Says,
) -> None:
    bench = Bench()
    before = bench.run(10.0)
    assert before.phase == "running"
    assert before.depth.valid
    name = f"{reason}:{'depth' if reason == 'lost' else f'sensor/{sensor}'}"
    assert bench.count(name) == 0
    before = bench.states[-1]
    bench.fault[sensor] = fault
    says(before, bench.run(seconds))
    assert bench.count(name) >= 1
    assert all(
        np.isfinite([state.depth.value, state.heading.value]).all() for state in bench.states
    )
    del bench.fault[sensor]
    after = bench.run(5.0)  # and it comes back
    assert after.depth.valid
    assert after.heading.valid
    assert after.heading_navigation is not None
    assert after.heading_navigation.valid
    assert abs(after.depth.value - before.depth.value) < 4.0 * after.depth.std + 0.02


def test_the_table_names_every_fault_of_every_sensor() -> None:
    for fault in (not_a_number, missing_axis, frozen, saturated, backwards, duplicated):
        assert {sensor for each, sensor, *_ in TABLE if each is fault} == set(SENSORS)


# Samples of the IMU that pile up while the service does not run: every one is used.

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


class Bunched:
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
    bench = Bunched()
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
