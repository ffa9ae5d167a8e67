"""What every reference law and every estimator promises, shipped or one's own: in the whole chain
of its stack file on virtual time. See docs/library.md.

pytest tests/contract/test_law_and_estimator.py --stack my_stack.toml
"""

from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from messages import events, topics
from messages.reference import Motion, Reference
from messages.sensors import ImuSample
from messages.simulator import FaultRequest
from messages.state import VehicleState
from messages.vehicle import Truth, VehicleStatus
from services.reference.settings import Settings as ReferenceSettings
from services.runtime.config.errors import NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tools.checks import known_tables

Floats = NDArray[np.float64]
Chain = tuple[str, str]  # stack, vehicle
S = 1_000_000_000  # [ns]
SIMULATOR = "simulator"
LEFT_OUT = ("recorder", "visualizer")
SCRIPT = """t,surge,sway,heave,yaw
0,0,0,0,0
1,0,0,0.6,0
6,0,0,0,0
12,0.5,0,0,0.5
17,0,0,0,0
23,0,0,-0.4,-0.5
26,0,0,0,0
40,0,0,0,0
"""
FLOWN_S = 38.0  # [s] after arming
LONGEST_START = 60.0  # [s]
NEAR_M, NEAR_RAD = 0.5, 0.2  # of the truth: units and signs, not how good it is
ALIKE = 0.9  # [-] correlation with the truth
LOST_S = 0.5  # [s] after the IMU fell silent, by when the drone acts


class ChainDive:
    """The chain with a pilot's script, and what it said."""

    def __init__(self, chain: Chain, folder: Path) -> None:
        script = folder / "sticks.csv"
        script.write_text(SCRIPT)
        stack_name, vehicle = chain
        services = Registry.read(stack_name)
        self.stack = Stack(
            pilot=f"script:{script}", out=str(folder), vehicle=vehicle, services=stack_name,
            virtual=True, overrides=["simulator.floor_depth=60"],
        )  # fmt: skip
        self.stack.check(known_tables(services))
        self.host = VirtualHost()
        names = [name for name in services if name not in LEFT_OUT]
        self.host.add_all(services.only({name: services[name] for name in names}), self.stack)
        self.heard: dict[str, list[Any]] = {}
        self.at: dict[str, list[int]] = {}  # [ns] when it was heard
        ear = self.host.node("ear", ["drone"])
        for topic in (topics.IMU, topics.STATE, topics.REFERENCE, topics.TRUTH, topics.STATUS):
            self._hear(ear, topic)
        self.breaks = self.host.node("voice", ["topside"]).publisher(topics.FAULT_REQUEST)

    def _hear(self, ear: Any, topic: Any) -> None:
        heard, at = self.heard.setdefault(topic.key, []), self.at.setdefault(topic.key, [])

        def hear(message: Any, now: int) -> None:
            heard.append(message)
            at.append(now)

        ear.each(topic, hear)

    def of(self, topic: Any) -> list[Any]:
        return self.heard[topic.key]

    @property
    def armed(self) -> bool:
        told: list[VehicleStatus] = self.of(topics.STATUS)
        return bool(told) and told[-1].armed

    def until_armed(self) -> "ChainDive":
        self.host.run(round(LONGEST_START * S), done=lambda: self.armed)
        assert self.armed, f"not armed after {LONGEST_START:g} s: {self.of(topics.STATUS)[-1]}"
        return self

    @property
    def counts(self) -> Counter[str]:
        return sum((node.counts for node in self.host.nodes.values()), Counter[str]())


def armed(chain: Chain, folder: Path) -> ChainDive:
    if SIMULATOR not in Registry.read(chain[0]):
        pytest.skip(f"{chain[0]} has no simulator, which alone says what is true")
    try:
        return ChainDive(chain, folder).until_armed()
    except NeedsRealTimeError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Chain], ChainDive]:
    @cache
    def fly(chain: Chain) -> ChainDive:
        dive = armed(chain, tmp_path_factory.mktemp("chain"))
        dive.host.run(dive.host.now + round(FLOWN_S * S))
        return dive

    return fly


@pytest.fixture
def dive(chain: Chain, flown: Callable[[Chain], ChainDive]) -> ChainDive:
    return flown(chain)


# The estimator.


def test_a_state_is_of_a_sample_of_the_imu_and_newer_than_the_one_before(dive: ChainDive) -> None:
    states: list[VehicleState] = dive.of(topics.STATE)
    samples: list[ImuSample] = dive.of(topics.IMU)
    assert {state.sensor_ns for state in states} <= {sample.stamp_ns for sample in samples}
    assert all(np.diff([state.sensor_ns for state in states]) > 0)
    assert len(states) > 0.9 * len(samples)
    ahead = [s.stamp_ns - at for s, at in zip(states, dive.at[topics.STATE.key], strict=True)]
    assert max(ahead) <= 0


def test_it_calibrates_first_and_then_runs(dive: ChainDive) -> None:
    phases = [state.phase for state in dive.of(topics.STATE)]
    changes = [now for before, now in zip(["", *phases], phases, strict=False) if now != before]
    assert changes[-1] == "running"
    assert changes.count("running") == 1, changes


def running(dive: ChainDive) -> list[VehicleState]:
    return [state for state in dive.of(topics.STATE) if state.phase == "running"]


def true(dive: ChainDive, states: list[VehicleState], what: Callable[[Truth], float]) -> Floats:
    """At the instants of the states."""
    truth: list[Truth] = dive.of(topics.TRUTH)
    at = [state.sensor_ns for state in states]
    return np.interp(at, [each.stamp_ns for each in truth], [what(each) for each in truth])


def test_depth_and_its_rate_are_metres_positive_down(dive: ChainDive) -> None:
    states = running(dive)
    depth = np.array([state.depth.value for state in states])
    rate = np.array([state.depth_rate.value for state in states])
    sunk = true(dive, states, lambda each: each.position[2])
    assert np.ptp(sunk) > 1.0
    assert np.abs(depth - sunk).max() < NEAR_M
    t = np.array([state.sensor_ns for state in states]) / S
    assert np.corrcoef(rate, np.gradient(sunk, t))[0, 1] > ALIKE


def test_heading_and_yaw_rate_are_radians_clockwise(dive: ChainDive) -> None:
    states = running(dive)
    heading = np.array([state.heading.value for state in states])
    rate = np.array([state.yaw_rate.value for state in states])
    turned = true(dive, states, lambda each: each.heading)
    assert np.ptp(turned) > 0.5
    assert np.abs((heading - heading[0]) - (turned - turned[0])).max() < NEAR_RAD
    t = np.array([state.sensor_ns for state in states]) / S
    assert np.corrcoef(rate, np.gradient(turned, t))[0, 1] > ALIKE


def test_every_estimate_says_how_sure_it_is(dive: ChainDive) -> None:
    for state in running(dive):
        for each in (state.depth, state.depth_rate, state.heading, state.yaw_rate, state.roll):
            assert np.isfinite(each.value)
            assert 0.0 < each.std < 10.0 or not each.valid


def test_without_an_imu_the_drone_acts(chain: Chain, tmp_path: Path) -> None:
    """No state, or one of which nothing is valid: then the failsafes see it."""
    dive = armed(chain, tmp_path)
    now = dive.host.now
    dive.breaks.put(
        FaultRequest(stamp_ns=now, id="contract", part="sensor/imu", fault="silent", value=None)
    )
    dive.host.run(now + round((LOST_S + 0.1) * S))  # with the way of the request
    assert dive.of(topics.STATUS)[-1].failsafe in ("state_lost", "imu_lost")


# The law.


def axes(dive: ChainDive) -> dict[str, list[Motion]]:
    told: list[Reference] = [each for each in dive.of(topics.REFERENCE) if each.armed]
    return {"depth": [each.depth for each in told], "heading": [each.heading for each in told]}


def test_no_plan_was_refused(dive: ChainDive) -> None:
    kind = events.LAW_REFUSED("heave").name.partition(":")[0]
    assert not [name for name in dive.counts if name.partition(":")[0] == kind]


def test_the_reference_is_continuous_and_agrees_with_itself(dive: ChainDive) -> None:
    settings = dive.stack.section("reference", ReferenceSettings)
    told = [each for each in dive.of(topics.REFERENCE) if each.armed]
    dt = np.diff([each.stamp_ns for each in told]) / S
    for name, most in (("depth", settings.heave.stop), ("heading", settings.yaw.stop)):
        values = np.array([(x.position, x.velocity, x.acceleration) for x in axes(dive)[name]])
        position, velocity, acceleration = values.T
        slack = 1e-6 + most.acceleration * 1e-3
        assert np.abs(np.diff(velocity)).max() <= (most.acceleration * dt).max() + slack
        moved = (velocity[1:] + velocity[:-1]) / 2 * dt
        off = np.abs(np.diff(position) - moved)
        # At rest what is held may be taken anew, where the drone has come to rest.
        moving = np.abs(velocity[1:]) > 1e-3
        assert off[moving].max() <= most.acceleration * (dt.max() ** 2) + 1e-6
        assert np.abs(acceleration).max() <= most.acceleration + slack


def test_it_comes_to_rest_where_the_stick_was_let_go(dive: ChainDive) -> None:
    for name, each in axes(dive).items():
        assert max(abs(x.velocity) for x in each) > 0.1, name
        assert abs(each[-1].velocity) < 1e-3, name
        assert abs(each[-1].acceleration) < 1e-3, name
