"""Every way in which a sensor can be bad, as a table: what is counted, and what the state says.

Through the virtual host, from the bytes of the sensor to `health` and `state`.
"""

from collections.abc import Callable
from math import nan
from typing import Any

import msgspec
import numpy as np
import pytest

from messages import topics
from messages.health import Health
from messages.message import Message
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.state import VehicleState
from messages.topic import Topic
from services.marine.vehicle import GRAVITY, SEA_WATER, Vehicle
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost

QUICK = Stack(overrides=["estimation.calibration.still_time=3"])  # [s] less to wait for
S = 1_000_000_000  # [ns]
SURFACE = 101_000.0 + SEA_WATER * GRAVITY * QUICK.section("vehicle", Vehicle).floating_depth
SENSORS = {"imu": topics.IMU, "pressure": topics.PRESSURE, "magnetometer": topics.MAGNETOMETER}
Fields = dict[str, Any]  # of a message, by name
Fault = Callable[[Fields, Fields], list[Fields]]  # sample, the one when the fault began → said


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


class Bench:
    """A vehicle at rest at the surface, whose sensors speak raw bytes."""

    def __init__(self) -> None:
        self.host, self.rng = VirtualHost(), np.random.default_rng(0)
        self.service = self.host.add("estimation", ServiceSpec(sides=["drone"]), QUICK)
        self.fault: dict[str, Fault] = {}
        self.first: dict[str, Fields] = {}
        self.states: list[VehicleState] = []
        self.health: list[Health] = []
        vehicle = self.host.node("vehicle", ["drone"])
        vehicle.each(topics.STATE, lambda state, _: self.states.append(state))
        vehicle.each(topics.HEALTH.of("estimation"), lambda health, _: self.health.append(health))
        for sensor in ("pressure", "magnetometer", "imu"):
            topic: Topic[Any] = SENSORS[sensor]
            say, count = self.host.side("drone").say(topic), iter(range(10**9))

            def speak(now: int, sensor: str = sensor, say: Any = say, count: Any = count) -> None:
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
            return PressureSample(stamp_ns=now, pressure=SURFACE + 300.0 * a)
        if sensor == "magnetometer":
            field = (15e-6 + 2e-7 * a, 2e-7 * b, 49e-6 + 2e-7 * c)
            return MagnetometerSample(stamp_ns=now, field=field)
        force, rate = (0.02 * a, 0.02 * b, 0.02 * c - GRAVITY), (1e-3 * p, 1e-3 * q, 1e-3 * r)
        return ImuSample(stamp_ns=now, specific_force=force, angular_rate=rate)

    def run(self, seconds: float) -> VehicleState:
        self.host.run(self.host.now + round(seconds * S))
        return self.states[-1]

    def count(self, name: str) -> int:
        """As `health/estimation` says, a second later at most."""
        self.run(1.1)
        return self.health[-1].counts.get(name, 0)


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


def test_a_pressure_sensor_that_boots_late_is_waited_for() -> None:
    bench = Bench()
    bench.fault["pressure"] = silent
    state = bench.run(8.0)
    assert state.phase == "calibrating"
    assert not state.depth.valid
    assert bench.count("waiting:sensor/pressure") == 1
    del bench.fault["pressure"]
    state = bench.run(2.0)
    assert state.phase == "running"
    assert state.depth.valid


@pytest.mark.slow
def test_a_minute_beside_steel_ends_the_validity_of_north() -> None:
    bench = Bench()
    bench.run(5.0)
    bench.fault["magnetometer"] = beside_steel
    state = bench.run(62.0)
    assert state.heading_navigation is not None
    assert not state.heading_navigation.valid
    assert state.heading.valid


def test_calibrated_beside_steel_there_is_no_north_at_all() -> None:
    bench = Bench()
    bench.fault["magnetometer"] = lambda sample, _: [sample | {"field": [6e-5, 1e-5, 6e-5]}]
    assert bench.run(5.0).heading_navigation is None
    assert bench.count("disturbed:sensor/magnetometer") == 1


def test_the_table_names_every_fault_of_every_sensor() -> None:
    for fault in (not_a_number, missing_axis, frozen, saturated, backwards, duplicated):
        assert {sensor for each, sensor, *_ in TABLE if each is fault} == set(SENSORS)
