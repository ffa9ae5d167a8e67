"""The simulator on the bus: rates, chain of events, reproducibility, restart in mid-dive."""

from collections import defaultdict
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from messages import topics
from messages.sensors import ImuSample
from messages.simulator import FaultAnswer, FaultRequest
from messages.vehicle import Truth
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node
from services.simulator.core import WorldCheckpoint
from services.simulator.service import wire
from tests.services.simulator.hulls import command

SECOND = 1_000_000_000  # [ns]
ROW = ServiceSpec(sides=["drone"])
DIVE = (2.0, 6.0, 0.0, 20.0)  # [N]


class Sea:
    """A simulator, a neighbour that commands its thrusters, and a listener to everything."""

    def __init__(self, stack: Stack | None = None, *thrust: float) -> None:
        self.host = VirtualHost()
        self.stack = stack or Stack()
        self.thrust: tuple[float, ...] = thrust
        self.heard: defaultdict[str, list[bytes]] = defaultdict(list)
        self.simulator = self.start()
        control = self.host.node("control", ["drone"])
        commands = control.publisher(topics.THRUSTERS)

        def on_imu(sample: ImuSample, now: int) -> None:
            if self.thrust:
                cause = sample.stamp_ns
                commands.put(replace(command(now, *self.thrust), sensor_ns=cause))

        control.each(topics.IMU, on_imu)
        self.host.side("drone").hear("**", self._listen)

    def start(self) -> Node:
        return self.host.add("simulator", ROW, self.stack, wire)

    def _listen(self, envelope: Envelope) -> None:
        self.heard[envelope.key].append(envelope.payload)

    def run(self, seconds: float) -> None:
        self.host.run(self.host.now + round(seconds * SECOND))

    def messages(self, topic: topics.Topic[Any]) -> list[Any]:
        return [msgspec.msgpack.decode(b, type=topic.message) for b in self.heard[topic.key]]

    def truth(self) -> Truth:
        return self.messages(topics.TRUTH)[-1]


def test_every_stream_comes_at_its_rate_stamped_with_the_instant_to_which_the_world_had_moved():
    sea = Sea()
    sea.run(4)
    always = (topics.IMU, topics.MAGNETOMETER, topics.PRESSURE, topics.BATTERY, topics.ACTUATION)
    for topic in (*always, topics.TRUTH):
        assert len(sea.heard[topic.key]) == pytest.approx(4 * topic.hz, abs=1)
    for topic in (topics.IMU, topics.TRUTH):
        stamps = [m.stamp_ns for m in sea.messages(topic)]
        assert stamps == [10_000_000 * (i + 1) for i in range(400)]
    stamps = [m.stamp_ns for m in sea.messages(topics.PRESSURE)]
    assert stamps == [round(SECOND / 42) * (i + 1) for i in range(len(stamps))]
    assert not {topics.DVL.key, topics.USBL.key} & set(sea.heard)  # without their tables


def test_the_same_seed_says_the_same_bytes_and_another_seed_others() -> None:
    def dive(seed: int) -> dict[str, list[bytes]]:
        sea = Sea(Stack(seed=seed), *DIVE)
        sea.run(3)
        return dict(sea.heard)

    assert dive(1) == dive(1)
    assert dive(1)["sensor/imu"] != dive(2)["sensor/imu"]
    assert dive(1)["sensor/pressure"] != dive(2)["sensor/pressure"]


def test_a_killed_simulator_resumes_its_dive_with_the_same_sensors() -> None:
    sea = Sea(None, *DIVE)
    sea.run(5)
    before = sea.truth()
    sea.host.kill("simulator")
    sea.run(1)
    sea.heard.clear()
    sea.thrust = ()
    sea.start()
    sea.run(0.02)
    after: Truth = sea.messages(topics.TRUTH)[0]
    assert after.position == pytest.approx(before.position, abs=0.3)  # at most 0.2 s ago
    assert after.position[2] > 2.0
    assert after.heading == pytest.approx(before.heading, abs=0.3)
    assert after.velocity == pytest.approx(before.velocity, abs=0.1)


def test_a_memory_of_another_vehicle_is_counted_and_the_dive_begins_anew() -> None:
    host = VirtualHost()
    other = WorldCheckpoint(state=(0.0,) * 13, thrust=(0.0,) * 8, heading=0.0, used_wh=0.0)
    host.node("simulator", ["drone"]).save_checkpoint(other)
    node = host.add("simulator", ROW, Stack(), wire)
    assert node.counts["malformed:memory"] == 1


def test_dvl_and_usbl_come_at_their_rates_and_late_but_stamped_when_measured() -> None:
    tables = ["simulator.dvl.rate=2.0", "simulator.dvl.latency=0.1", "simulator.usbl.latency=2.5"]
    sea = Sea(Stack(overrides=tables), *DIVE)
    arrivals: list[int] = []
    sea.host.side("drone").hear(topics.USBL.key, lambda _: arrivals.append(sea.host.now))
    sea.run(10.05)
    assert len(sea.messages(topics.DVL)) == 19  # the twentieth is still on its way
    stamps = [m.stamp_ns for m in sea.messages(topics.USBL)]
    assert stamps == [2 * SECOND, 4 * SECOND, 6 * SECOND]
    assert [at - stamp for at, stamp in zip(arrivals, stamps, strict=True)] == [5 * SECOND // 2] * 3
    fix, there = sea.messages(topics.USBL)[-1], sea.messages(topics.TRUTH)[599]
    assert there.stamp_ns == fix.stamp_ns
    assert (fix.north, fix.east) == pytest.approx(there.position[:2], abs=2.0)


def ask_for(sea: Sea, *requests: FaultRequest) -> list[FaultAnswer]:
    """The answers to these requests."""
    topside = sea.host.node("topside", ["drone"])
    say = topside.publisher(topics.FAULT_REQUEST)
    for request in requests:
        say.put(msgspec.structs.replace(request, stamp_ns=sea.host.now))
        sea.run(0.05)
    return sea.messages(topics.FAULT_ANSWER)


def fault(part: str, kind: Any, name: str = "a") -> FaultRequest:
    return FaultRequest(stamp_ns=0, id=name, part=part, fault=kind)


def test_a_repeated_request_is_done_once_and_answered_each_time() -> None:
    sea = Sea(None, *DIVE)
    sea.run(1)
    broken, mended = fault("port", "dead", "1"), fault("port", "none", "2")
    answers = ask_for(sea, broken, mended, broken)
    assert [(a.id, a.accepted) for a in answers] == [("1", True), ("2", True), ("1", True)]
    assert answers[2].stamp_ns > answers[0].stamp_ns
    sea.run(0.1)
    assert sea.truth().faults == ()


def test_a_fault_is_a_warning_and_its_repair_is_information() -> None:
    sea = Sea()
    shown: list[tuple[str, str]] = []
    sea.host.show(lambda line: shown.append((line.level, line.text)))
    ask_for(sea, fault("port", "dead", "1"), fault("all", "none", "2"))
    assert shown == [("warning", "simulated fault: port dead"), ("info", "mended: all")]


def test_a_silent_sensor_is_counted_and_a_broken_one_is_malformed_at_every_receiver() -> None:
    sea = Sea()
    heard: list[int] = []
    receiver = sea.host.node("receiver", ["drone"])
    receiver.each(topics.PRESSURE, lambda sample, _: heard.append(sample.stamp_ns))
    ask_for(sea, fault("sensor/imu", "silent", "1"), fault("sensor/pressure", "broken", "2"))
    sea.heard.clear()
    heard.clear()
    sea.run(1)
    assert topics.IMU.key not in sea.heard
    assert len(sea.heard[topics.TRUTH.key]) == 100
    assert sea.simulator.counts["silent_by_fault:sensor/imu"] >= 100
    assert len(sea.heard[topics.PRESSURE.key]) == pytest.approx(42, abs=1)
    assert heard == []
    assert receiver.counts["malformed:sensor/pressure"] >= 41
