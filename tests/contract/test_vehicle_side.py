"""What every vehicle side promises, simulated or not. See docs/your-own-vehicle.md.

A side that says it needs real time (`stack.virtual`) is run as a process instead.
"""

import math
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Generator
from contextlib import contextmanager
from itertools import cycle, pairwise
from pathlib import Path
from statistics import fmean
from typing import Any, Protocol

import msgspec
import numpy as np
import pytest

from messages import topics
from messages.control import ThrusterCommand
from messages.health import Health
from messages.pilot import PilotRequest
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.topic import AnyTopic
from messages.vehicle import Actuation
from services.estimation.sensor import RATE_TOLERANCE
from services.estimation.settings import Settings as EstimationSettings
from services.marine.attitude import wrapped
from services.marine.vehicle import Vehicle, wrench_per_newton
from services.runtime.bus.envelope import Say
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.config.errors import NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.launch.local_stack import local_stack
from services.runtime.launch.process_plan import Dive
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from services.vehicle.mounting import MountedAxes
from tools.checks import known_tables

MS, S = 1_000_000, 1_000_000_000  # [ns]
SENSORS: tuple[AnyTopic, ...] = (
    topics.IMU,
    topics.MAGNETOMETER,
    topics.PRESSURE,
    topics.DVL,
    topics.USBL,
)
ALWAYS = (topics.IMU, topics.PRESSURE, topics.ACTUATION)  # without them nothing flies
ENCLOSURE = (topics.BATTERY, topics.LEAK, topics.TEMPERATURE)
SAID: tuple[AnyTopic, ...] = (*SENSORS, *ENCLOSURE, topics.ACTUATION)
HEAVE, YAW = 2, 5
START_S = 1.0  # [s] in which thrusters follow a command: a board may have to arm them first
SHARE = 0.6  # [-] of the limits that a command asks for
JITTER_NS = 2 * MS  # [ns] between two clocks readings in two processes
Side = tuple[str, str]  # stack, vehicle


class Place(Protocol):
    """Where a vehicle side runs: on virtual or on real time."""

    def now(self) -> int: ...

    def run(self, seconds: float) -> None: ...


class Bench:
    """A vehicle side alone, with somebody who commands its thrusters and hears what it says."""

    def __init__(self, place: Place, node: Node, say: Say, stack: Stack) -> None:
        self._requests = node.publisher(topics.PILOT_REQUEST)
        self.vehicle = stack.section("vehicle", Vehicle)
        self.estimation = stack.section("estimation", EstimationSettings)
        self.heard: defaultdict[str, list[tuple[int, Any]]] = defaultdict(list)  # arrival, message
        self.counts: Counter[str] = Counter()  # of the vehicle side
        self.commanding: Callable[[int], None] | None = None
        self.say, self._place = say, place
        for topic in SAID:
            node.each(topic, self._keep(topic))
        node.each(topics.HEALTH, self._health)
        node.every(topics.THRUSTERS.hz, self._command)

    def _keep(self, topic: AnyTopic) -> Callable[[Any, int], None]:
        return lambda message, now: self.heard[topic.key].append((now, message))

    def _health(self, health: Health, _: int) -> None:
        self.counts.update(Counter(health.counts) - self.counts)

    def _command(self, now: int) -> None:
        if self.commanding is not None:
            self.commanding(now)

    def now(self) -> int:
        return self._place.now()

    def run(self, seconds: float) -> None:
        self._place.run(seconds)

    def settle(self) -> None:
        """Until the side is up: a board may have to be checked first."""
        for _ in range(50):
            self.run(0.2)
            if all(self.all(topic) for topic in ALWAYS):
                return
        silent = [topic.key for topic in ALWAYS if not self.all(topic)]
        pytest.fail(f"the vehicle side says no {' and no '.join(silent)} within 10 s")

    def all(self, topic: AnyTopic, since: int = 0) -> list[Any]:
        return [m for _, m in self.heard[topic.key] if m.stamp_ns >= since]

    def disarm(self, epoch: int) -> None:
        """As the pilot does."""
        now = self.now()
        self._requests.put(PilotRequest(stamp_ns=now, id=f"{now}", kind="disarm", epoch=epoch))

    def ask(
        self,
        thrust: tuple[float, ...],
        *,
        armed: bool = True,
        epoch: int = 1,
        armed_ns: int | None = None,
    ) -> None:
        """This thrust [N] a hundred times a second from now on."""

        def command(now: int) -> None:
            asked = ThrusterCommand(
                stamp_ns=now, sensor_ns=now - 1, pilot_ns=now - 2, thrust=thrust,
                armed=armed, epoch=epoch, armed_ns=armed_ns,
            )  # fmt: skip
            self.put(msgspec.structs.asdict(asked))

        self.commanding = command

    def put(self, fields: dict[str, Any]) -> None:
        """A command, whatever is in it."""
        self.say(msgspec.msgpack.encode(fields))

    def be_silent(self) -> None:
        self.commanding = None

    def along(self, axis: int, share: float = SHARE) -> tuple[float, ...]:
        """[N] Per thruster, for a force or moment along an axis, within a share of the limits."""
        columns = np.array([wrench_per_newton(t) for t in self.vehicle.thruster]).T
        thrust = np.linalg.pinv(columns) @ np.eye(6)[axis]
        limits = [t.limits for t in self.vehicle.thruster]
        most = max(
            f / (high if f > 0 else low) for f, (low, high) in zip(thrust, limits, strict=True) if f
        )
        return tuple((share / most * thrust).tolist())

    def produced(self, since: int = 0) -> list[Actuation]:
        return self.all(topics.ACTUATION, since)

    def decay_s(self) -> float:
        """[s] Until a thruster with a lag has come to rest."""
        return 12.0 / min(-mode.pole.real for t in self.vehicle.thruster for mode in t.modes)

    def at_rest_again(self, since: int) -> bool:
        """Do all thrusters produce nothing from this time on, by what the side says?"""
        reports = self.produced(since)
        most = [0.01 * t.max_thrust for t in self.vehicle.thruster]
        return bool(reports) and all(
            abs(f) <= limit for a in reports for f, limit in zip(a.thrust, most, strict=True)
        )


class Virtual:
    def __init__(self, host: VirtualHost) -> None:
        self._host = host

    def now(self) -> int:
        return self._host.now

    def run(self, seconds: float) -> None:
        self._host.run(self._host.now + round(seconds * S))


class Real:
    def __init__(self, node: Node, woken: threading.Event, pump: Callable[[], None]) -> None:
        self._node, self._woken, self._pump = node, woken, pump

    def now(self) -> int:
        return time.monotonic_ns()

    def run(self, seconds: float) -> None:
        end = self.now() + round(seconds * S)
        while self.now() < end:
            self._node.step()
            wait = (min(end, self._node.deadline()) - self.now()) / 1e9
            if wait > 0:
                self._woken.wait(wait)
            self._woken.clear()
        self._pump()


def stack_of(side: Side, folder: Path, *, virtual: bool) -> tuple[Registry, Stack]:
    """The vehicle side alone, checked as a dive is before it starts."""
    services, vehicle = Registry.read(side[0]), side[1]
    services = services.only({name: services[name] for name in services.vehicle_side})
    stack = Stack(vehicle=vehicle, out=str(folder), virtual=virtual)
    stack.check(known_tables(services))
    return services, stack


def virtual_bench(side: Side, folder: Path) -> Bench:
    services, stack = stack_of(side, folder, virtual=True)
    host = VirtualHost()
    node = host.node("contract", ["drone"])
    say = host.side("drone").say(topics.THRUSTERS)
    bench = Bench(Virtual(host), node, say, stack)
    host.add_all(services, stack)
    return bench


@contextmanager
def real_bench(side: Side, folder: Path) -> Generator[Bench]:
    services, stack = stack_of(side, folder, virtual=False)
    with local_stack(Dive(stack, services)) as local:
        local.start_services()

        def look() -> bool:
            local.pump()
            return True

        local.wait_alive(30.0, look)
        woken = threading.Event()
        with open_bus(local.plan.endpoints["drone"], stack.vehicle_name) as bus:
            node = Node("contract", {"drone": bus}, time.monotonic_ns, VolatileCheckpoint())
            node.wake = woken.set
            yield Bench(Real(node, woken, local.pump), node, bus.say(topics.THRUSTERS), stack)


@pytest.fixture
def bench(side: Side, tmp_path: Path) -> Generator[Bench]:
    try:
        made = virtual_bench(side, tmp_path)
    except NeedsRealTimeError:
        with real_bench(side, tmp_path) as made:
            made.settle()
            yield made
        return
    made.settle()
    yield made


# What it says.


def test_sensors_come_at_their_rates(bench: Bench) -> None:
    began = bench.now()
    bench.run(5.0)
    watch = bench.estimation.watch
    nominal = {t.key: t.hz for t in (topics.IMU, topics.ACTUATION)}
    nominal[topics.PRESSURE.key] = watch.pressure_rate
    nominal[topics.MAGNETOMETER.key] = watch.magnetometer_rate
    for topic in ALWAYS:
        assert bench.all(topic, began), f"nothing on {topic.key}"
    for key, hz in nominal.items():
        stamps = [m.stamp_ns for _, m in bench.heard[key] if m.stamp_ns >= began]
        if stamps:
            rate = (len(stamps) - 1) / (stamps[-1] - stamps[0]) * S
            assert rate == pytest.approx(hz, rel=RATE_TOLERANCE), key


def test_every_stream_is_stamped_in_order_and_not_from_the_future(bench: Bench) -> None:
    bench.run(5.0)
    for topic in SAID:
        messages = bench.heard[topic.key]
        for (_, before), (_, after) in pairwise(messages):
            assert after.stamp_ns > before.stamp_ns, topic.key
            assert after.seq > before.seq, topic.key
        for arrival, message in messages:
            assert message.stamp_ns <= arrival + JITTER_NS, topic.key
            if topic in ALWAYS and topic.stale_after_ns is not None:
                assert arrival - message.stamp_ns <= topic.stale_after_ns, topic.key


def test_at_rest_the_sensors_say_what_rest_is(bench: Bench) -> None:
    began = bench.now()
    bench.run(3.0)
    imu: list[ImuSample] = bench.all(topics.IMU, began)
    axes = MountedAxes(bench.vehicle.mounting.imu)
    forces = [axes.to_body(m.specific_force) for m in imu]
    force = [fmean(part) for part in zip(*forces, strict=True)]
    assert math.hypot(*force) == pytest.approx(9.81, abs=0.5), "specific force in m/s²"
    assert force[2] < -8.5, "at rest the specific force points up: z is -9.8 with z down"
    rate = [fmean(part) for part in zip(*[m.angular_rate for m in imu], strict=True)]
    assert math.hypot(*rate) < 0.1, "angular rate in rad/s"
    pressures: list[PressureSample] = bench.all(topics.PRESSURE, began)
    assert 70e3 < fmean(m.pressure for m in pressures) < 120e3, "absolute pressure in Pa"
    fields: list[MagnetometerSample] = bench.all(topics.MAGNETOMETER, began)
    for sample in fields:
        assert 15e-6 < math.hypot(*sample.field) < 100e-6, "magnetic field in T"
    for battery in bench.all(topics.BATTERY):
        assert 3.0 < battery.voltage < 1000.0, "voltage in V"


def test_actuation_is_whole_and_says_which_command_it_is_of(bench: Bench) -> None:
    first = bench.produced()[0]
    assert first.stale, "nothing was commanded yet"
    assert not any(first.thrust)
    bench.ask(bench.along(HEAVE, 0.2))
    bench.run(START_S)
    asked = bench.now()
    bench.run(0.5)
    limits = [t.limits for t in bench.vehicle.thruster]
    for report in bench.produced(asked):
        assert len(report.thrust) == len(bench.vehicle.thruster)
        assert all(1.2 * a <= f <= 1.2 * b for f, (a, b) in zip(report.thrust, limits, strict=True))
        assert not report.stale
        assert report.actuated_ns is not None
        assert report.actuated_ns <= report.stamp_ns
        assert report.sensor_ns is not None
        assert report.pilot_ns == report.sensor_ns - 1, "stamps of the command behind it"
        assert report.stamp_ns - report.sensor_ns <= 200 * MS
    assert any(bench.produced(asked)[-1].thrust)


# What it does.


def test_thrust_down_makes_the_pressure_rise(bench: Bench, still: bool) -> None:
    if still:
        pytest.skip("on the bench nothing moves")
    began = bench.now()
    bench.run(1.0)
    before = fmean(m.pressure for m in bench.all(topics.PRESSURE, began))
    bench.ask(bench.along(HEAVE))
    bench.run(4.0)
    after = fmean(m.pressure for m in bench.all(topics.PRESSURE, bench.now() - S // 2))
    assert after > before + 1000.0, "thrust along +z is down, and the pressure in Pa rises"


def test_a_clockwise_moment_turns_clockwise(bench: Bench, still: bool) -> None:
    if still:
        pytest.skip("on the bench nothing moves")
    down, turn = bench.along(HEAVE, 0.4), bench.along(YAW, 0.3)
    bench.ask(down)
    bench.run(3.0)  # all thrusters under water
    bench.ask(tuple(a + b for a, b in zip(down, turn, strict=True)))
    began = bench.now()
    bench.run(2.0)
    axes = MountedAxes(bench.vehicle.mounting.imu)
    imu: list[ImuSample] = bench.all(topics.IMU, began)
    yaw = [(m.stamp_ns, axes.to_body(m.angular_rate)[2]) for m in imu]
    assert fmean(r for _, r in yaw[len(yaw) // 2 :]) > 0.05, "a moment about +z is clockwise"
    field = MountedAxes(bench.vehicle.mounting.magnetometer)
    seen = [(m.stamp_ns, field.to_body(m.field)) for m in bench.all(topics.MAGNETOMETER, began)]
    if seen:
        turned = sum((b - a) / S * r for (a, r), (b, _) in pairwise(yaw))
        headings = [math.atan2(-y, x) for _, (x, y, _) in seen]
        compass = sum(wrapped(b - a) for a, b in pairwise(headings))
        assert compass == pytest.approx(turned, rel=0.3, abs=0.2), "compass and gyroscope agree"


# What it refuses, on virtual time and as a process.


def silence_stops(bench: Bench) -> None:
    bench.ask(bench.along(HEAVE, 0.3))
    bench.run(1.0)
    assert any(bench.produced()[-1].thrust)
    bench.be_silent()
    silent = bench.now()
    bench.run(0.2 + bench.decay_s() + 0.5)
    ended = silent + 200 * MS
    assert all(report.stale for report in bench.produced(ended + JITTER_NS + 10 * MS))
    assert bench.at_rest_again(ended + round(bench.decay_s() * S))
    assert bench.all(topics.IMU, ended), "a driver goes on measuring when nobody commands"
    bench.ask(bench.along(HEAVE, 0.3))
    bench.run(START_S)
    assert any(bench.produced()[-1].thrust), "commands act again after a silence"
    assert not bench.produced()[-1].stale


def a_disarm_stops(bench: Bench) -> None:
    """By the pilot's request alone, while a control that hangs or is wrong goes on commanding."""
    armed_ns = bench.now()
    bench.ask(bench.along(HEAVE, 0.3), armed_ns=armed_ns)
    bench.run(1.0)
    bench.disarm(epoch=0)
    bench.run(0.5)
    assert any(bench.produced()[-1].thrust), "the disarm of another epoch does nothing"
    disarmed = bench.now()
    bench.disarm(epoch=1)
    bench.run(bench.decay_s() + 0.5)
    assert bench.at_rest_again(disarmed + round(bench.decay_s() * S)), "pilot/request: disarm"
    bench.ask((0.0,) * len(bench.vehicle.thruster), armed=False)
    bench.run(0.3)
    began = bench.now()
    bench.ask(bench.along(HEAVE, 0.3), armed_ns=armed_ns)  # woken again, with what it knew before
    bench.run(0.5)
    assert bench.at_rest_again(began), "the arming that was disarmed arms again"
    bench.ask(bench.along(HEAVE, 0.3), armed_ns=bench.now())
    bench.run(START_S)
    assert any(bench.produced()[-1].thrust), "a later arming acts"


def nothing_wrong_acts(bench: Bench, each_s: float) -> None:
    """Everything wrong for so long; past a health report each is seen to be counted, too."""
    count, now = len(bench.vehicle.thruster), bench.now
    some = list(bench.along(HEAVE, 0.3))
    whole = {"sensor_ns": None, "pilot_ns": None, "thrust": some, "ttl_ms": 200.0, "epoch": 3}
    # An older epoch is refused while the newer one is heard.
    older = cycle([{"epoch": 3, "thrust": [0.0] * count}, {"epoch": 2}])
    wrong: list[Callable[[], dict[str, Any]]] = [
        lambda: {**whole, "stamp_ns": now(), "armed": True, "thrust": some[1:]},
        lambda: {**whole, "stamp_ns": now(), "armed": True, "thrust": [*some, 1.0]},
        lambda: {**whole, "stamp_ns": now(), "armed": True, "thrust": []},
        lambda: {**whole, "stamp_ns": now(), "armed": True, "thrust": [math.nan] * count},
        lambda: {**whole, "stamp_ns": now(), "armed": True, "thrust": [math.inf] * count},
        lambda: {**whole, "stamp_ns": now(), "armed": True, "thrust": ["full"] * count},
        lambda: {**whole, "stamp_ns": now(), "armed": True, **next(older)},
        lambda: {**whole, "stamp_ns": now() - S, "armed": True},
        lambda: {**whole, "stamp_ns": now() + 10 * S, "armed": True},
        lambda: {**whole, "stamp_ns": now(), "armed": True, "ttl_ms": 60_000.0},
        lambda: {**whole, "stamp_ns": now(), "armed": False},
        lambda: {**whole, "stamp_ns": now()},  # nobody said that it may
        dict,
    ]
    bench.ask((0.0,) * count, epoch=3)
    bench.run(0.3)
    for each in wrong:
        counted, began = sum(refusals(bench)), bench.now()
        bench.commanding = lambda _, each=each: bench.put(each())
        bench.run(each_s)
        assert bench.at_rest_again(began), each()
        assert each_s < 1.0 or sum(refusals(bench)) > counted, f"not counted: {each()}"
    bench.commanding = lambda _: bench.say(b"\xc1 no message")
    began = bench.now()
    bench.run(0.3)
    assert bench.at_rest_again(began)
    bench.ask(tuple(some), epoch=3)
    bench.run(START_S)
    assert any(bench.produced()[-1].thrust), "what is right still acts"


def refusals(bench: Bench) -> list[int]:
    return [n for name, n in bench.counts.items() if name.endswith(":control/thrusters")]


def test_silence_stops_the_thrusters(bench: Bench) -> None:
    silence_stops(bench)


def test_a_disarm_stops_the_thrusters(bench: Bench) -> None:
    a_disarm_stops(bench)


def test_nothing_wrong_acts(bench: Bench) -> None:
    nothing_wrong_acts(bench, each_s=1.2)


def test_thrust_is_held_to_the_limits(bench: Bench) -> None:
    bench.ask(tuple(1e6 if i % 2 else -1e6 for i in range(len(bench.vehicle.thruster))))
    bench.run(2.2)
    limits = [t.limits for t in bench.vehicle.thruster]
    for report in bench.produced():
        assert all(1.2 * a <= f <= 1.2 * b for f, (a, b) in zip(report.thrust, limits, strict=True))
    assert sum(n for name, n in bench.counts.items() if name.startswith("saturated:")) > 0


@pytest.mark.slow
@pytest.mark.system
def test_a_process_stops_and_refuses_as_well(real_side: Side, tmp_path: Path) -> None:
    with real_bench(real_side, tmp_path) as bench:
        bench.settle()
        silence_stops(bench)
        a_disarm_stops(bench)
        nothing_wrong_acts(bench, each_s=0.3)
        assert sum(refusals(bench)) > 0
