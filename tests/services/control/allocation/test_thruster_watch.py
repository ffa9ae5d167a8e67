"""The watch: it names a fault within a second of thrust, and never a thruster that is sound."""

from collections.abc import Callable, Iterator
from math import exp

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.vehicle import Actuation
from services.control.allocation.thruster_watch import ThrusterWatch, WatchedThruster
from services.marine.vehicle import Vehicle, driven

some = settings(max_examples=25, deadline=None)
TICK_NS = 10_000_000
DEEP = 5.0  # [m]
Fault = Callable[[float], float]  # from healthy to produced thrust
Commands = Iterator[tuple[float, ...]]

HEALTHY: Fault = lambda thrust: thrust  # noqa: E731
FAULTS: dict[str, tuple[Fault, float]] = {
    "dead": (lambda _: 0.0, 0.0),
    "reversed": (lambda thrust: -thrust, -1.0),
    "weak": (lambda thrust: 0.4 * thrust, 0.4),
}
STUCK: Fault = lambda _: 12.0  # noqa: E731


class Driver:
    """Thrusters with lag, a delay on the way, and noise in the report; all first order."""

    def __init__(self, vehicle: Vehicle, delay: int, noise: float, seed: int) -> None:
        self.vehicle, self.delay, self.noise = vehicle, delay, noise
        self.faults = [HEALTHY] * len(vehicle.thruster)
        self.randomness = np.random.default_rng(seed)
        self.on_the_way = list[tuple[int, int, tuple[float, ...]]]()
        self.thrust = [0.0] * len(vehicle.thruster)
        self.command = (0.0,) * len(vehicle.thruster)
        self.cause: tuple[int, int] | None = None
        self.measured = True

    def take(self, now: int, command: tuple[float, ...]) -> None:
        self.on_the_way.append((now + self.delay, now, command))

    def move(self, since: int, until: int) -> None:
        while self.on_the_way and self.on_the_way[0][0] <= until:
            at, sensor_ns, command = self.on_the_way.pop(0)
            self.drive(at - since)
            since, self.command, self.cause = at, command, (at, sensor_ns)
        self.drive(until - since)

    def drive(self, span: int) -> None:
        for i, thruster in enumerate(self.vehicle.thruster):
            end = driven(thruster, self.command[i])
            left = exp(-span / 1e9 / thruster.time_constant)
            self.thrust[i] = end + (self.thrust[i] - end) * left

    def report(self, now: int, *, stale: bool = False) -> Actuation:
        noise = self.noise * self.randomness.standard_normal(len(self.thrust))
        rows = zip(self.faults, self.thrust, noise.tolist(), strict=True)
        produced = [fault(thrust) + n for fault, thrust, n in rows]
        return Actuation(
            stamp_ns=now,
            thrust=tuple(produced),
            measured=self.measured,
            actuated_ns=self.cause[0] if self.cause else None,
            sensor_ns=self.cause[1] if self.cause else None,
            pilot_ns=None,
            stale=stale,
            power=0.0,
        )


def histories(vehicle: Vehicle, kind: str, seed: int) -> Commands:
    """Commands of a hundred a second, wild to gentle, all within the limits."""
    rng, n = np.random.default_rng(seed), len(vehicle.thruster)
    low = np.array([t.limits[0] for t in vehicle.thruster])
    high = np.array([t.limits[1] for t in vehicle.thruster])
    value, tick = np.zeros(n), 0
    while True:
        if kind == "noise":
            value = rng.uniform(low, high)
        elif kind == "steps" and tick % rng.integers(5, 80) == 0:
            value = rng.uniform(low, high) * rng.uniform(0.0, 1.0)
        elif kind == "walk":
            value = np.clip(value + 2.0 * rng.standard_normal(n), low, high)
        elif kind == "whine":
            value = high * np.sin(2 * np.pi * rng.uniform(7.9, 8.1) * tick * 0.01)
        elif kind == "small":
            value = rng.uniform(-2.0, 2.0, n)
        tick += 1
        yield tuple(value.tolist())


KINDS = st.sampled_from(["noise", "steps", "walk", "whine", "small"])


def run(
    watch: ThrusterWatch, driver: Driver, commands: Commands, ticks: int, start: int = 0
) -> Iterator[int]:
    """Yields after each report, [ns] since the start of everything."""
    for k in range(start, start + ticks):
        now = k * TICK_NS
        command = next(commands)
        watch.sent(now, command)
        driver.take(now, command)
        driver.move(now, now + TICK_NS)
        watch.heard(driver.report(now + TICK_NS), DEEP)
        yield now + TICK_NS


@some
@given(
    kind=KINDS,
    seed=st.integers(0, 10_000),
    delay=st.integers(0, 30_000_000),
    noise=st.floats(0.0, 0.4),
)
def test_a_sound_thruster_is_never_suspected(
    heavy: Vehicle, kind: str, seed: int, delay: int, noise: float
) -> None:
    watch, driver = ThrusterWatch(heavy), Driver(heavy, delay, noise, seed)
    for _ in run(watch, driver, histories(heavy, kind, seed), 400):
        assert set(watch.verdicts) == {"fine"}


@some
@given(
    kind=st.sampled_from(["steps", "walk", "noise"]),
    name=st.sampled_from(sorted(FAULTS)),
    index=st.integers(0, 3),
    seed=st.integers(0, 10_000),
    delay=st.integers(0, 30_000_000),
)
def test_a_fault_is_named_and_forgotten_when_it_is_over(
    pioneer: Vehicle, kind: str, name: str, index: int, seed: int, delay: int
) -> None:
    watch, driver = ThrusterWatch(pioneer), Driver(pioneer, delay, 0.2, seed)
    fault, gain = FAULTS[name]
    commands = histories(pioneer, kind, seed)
    for _ in run(watch, driver, commands, 100):
        pass
    driver.faults[index] = fault
    for _ in run(watch, driver, commands, 400, 100):
        pass
    expected = ["fine"] * 4
    expected[index] = name
    assert list(watch.verdicts) == expected
    assert watch.thrusters[index].gain == pytest.approx(gain, abs=0.15)
    driver.faults[index] = HEALTHY
    for _ in run(watch, driver, commands, 400, 500):
        pass
    assert set(watch.verdicts) == {"fine"}
    assert {watched.gain for watched in watch.thrusters} == {1.0}


@some
@given(
    name=st.sampled_from(sorted(FAULTS)), force=st.floats(5.0, 35.0), sign=st.sampled_from([-1, 1])
)
def test_a_verdict_takes_between_half_a_second_and_one_of_steady_thrust(
    pioneer: Vehicle, name: str, force: float, sign: int
) -> None:
    watch, driver = ThrusterWatch(pioneer), Driver(pioneer, 3_000_000, 0.1, 1)
    driver.faults[2] = FAULTS[name][0]
    steady = iter(lambda: (0.0, 0.0, sign * force, 0.0), None)
    found = [now for now in run(watch, driver, steady, 120) if watch.verdicts[2] != "fine"]
    assert 0.5e9 < found[0] < 1.1e9
    assert watch.verdicts[2] == name


def test_a_thruster_that_runs_by_itself_is_as_good_as_dead(pioneer: Vehicle) -> None:
    watch, driver = ThrusterWatch(pioneer), Driver(pioneer, 0, 0.1, 1)
    driver.faults[0] = STUCK
    still = iter(lambda: (0.0, 0.0, 0.0, 0.0), None)
    for _ in run(watch, driver, still, 200):
        pass
    assert watch.verdicts[0] == "dead"
    for _ in run(watch, driver, histories(pioneer, "walk", 3), 600, 200):
        assert watch.verdicts[0] != "fine"
        assert watch.verdicts[1:] == ("fine", "fine", "fine")


def test_a_thruster_out_of_the_water_is_not_judged(pioneer: Vehicle) -> None:
    watch, driver = ThrusterWatch(pioneer), Driver(pioneer, 0, 0.0, 1)
    driver.faults[3] = FAULTS["dead"][0]
    for k in range(200):
        now = k * TICK_NS
        watch.sent(now, (0.0, 0.0, 0.0, 20.0))
        driver.take(now, (0.0, 0.0, 0.0, 20.0))
        driver.move(now, now + TICK_NS)
        watch.heard(driver.report(now + TICK_NS), depth=0.1)
    assert set(watch.verdicts) == {"fine"}


def test_stopped_by_the_driver_is_not_dead(pioneer: Vehicle) -> None:
    """A report that commands are stale says why nothing turns."""
    watch, driver = ThrusterWatch(pioneer), Driver(pioneer, 0, 0.0, 1)
    for k in range(200):
        now = k * TICK_NS
        watch.sent(now, (20.0, 20.0, 20.0, 20.0))
        watch.heard(driver.report(now + TICK_NS, stale=True), DEEP)
    assert set(watch.verdicts) == {"fine"}


def test_what_is_only_believed_is_not_judged(pioneer: Vehicle) -> None:
    watch, driver = ThrusterWatch(pioneer), Driver(pioneer, 0, 0.0, 0)
    driver.measured, driver.faults[0] = False, FAULTS["dead"][0]
    for _ in run(watch, driver, histories(pioneer, "steps", 0), 300):
        assert set(watch.verdicts) == {"fine"}


@some
@given(st.integers(0, 10_000), st.lists(st.integers(1, 60), min_size=1, max_size=20))
def test_lost_and_repeated_reports_do_no_harm(pioneer: Vehicle, seed: int, gaps: list[int]) -> None:
    watch, driver = ThrusterWatch(pioneer), Driver(pioneer, 2_000_000, 0.1, seed)
    commands, k = histories(pioneer, "steps", seed), 0
    for gap in gaps:
        for _ in range(gap):
            now, command = k * TICK_NS, next(commands)
            watch.sent(now, command)
            driver.take(now, command)
            driver.move(now, now + TICK_NS)
            k += 1
        report = driver.report(k * TICK_NS)
        watch.heard(report, DEEP)
        watch.heard(report, DEEP)
        assert set(watch.verdicts) == {"fine"}


def test_a_dead_thruster_is_tried_again_a_quarter_of_the_time(pioneer: Vehicle) -> None:
    watch, driver = ThrusterWatch(pioneer), Driver(pioneer, 0, 0.0, 1)
    driver.faults[2] = FAULTS["dead"][0]
    steady = iter(lambda: (0.0, 0.0, 20.0, 0.0), None)
    for _ in run(watch, driver, steady, 120):
        pass
    assert watch.verdicts[2] == "dead"
    nothing = (5.0, 5.0, 0.0, 5.0)
    asked = [watch.probing(nothing, k * TICK_NS) for k in range(600)]
    assert sum(thrust != nothing for thrust in asked) == 150
    assert {thrust[2] for thrust in asked} == {0.0, 3.5}
    assert {(a, b, d) for a, b, _, d in asked} == {(5.0, 5.0, 5.0)}


@pytest.mark.parametrize("push", [5.0, -5.0, 500.0])
def test_thrust_that_nobody_asked_for_is_that_of_a_dead_thruster(
    pioneer: Vehicle, push: float
) -> None:
    """A thruster that was never commanded has a model of exactly zero, so there is no slope."""
    watched = WatchedThruster(pioneer.thruster[0])
    for tick in range(300):
        watched.judge(0.0, 0.0 if tick < 10 else push, 0.01, 0.01)
    assert (watched.verdict, watched.gain) == ("dead", 0.0)
