"""What every reference law and every estimator promises, shipped or one's own: in the whole chain
of its stack file on virtual time. See docs/library.md.

pytest tests/contract/test_law_and_estimator.py --stack my_stack.toml
"""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from messages import events, topics
from messages.reference import Motion
from messages.simulator import FaultRequest
from messages.state import VehicleState
from messages.vehicle import Truth
from services.reference.settings import Settings as ReferenceSettings
from services.runtime.config.errors import NeedsRealTimeError
from services.runtime.hosts.registry import Registry
from tests.support.dive import DEEP, Dive
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
NEAR_M, NEAR_RAD = 0.5, 0.2  # of the truth: units and signs, not how good it is
ALIKE = 0.9  # [-] correlation with the truth
LOST_S = 0.5  # [s] after the IMU fell silent, by when the drone acts


class ChainDive(Dive):
    """The chain with a pilot's script, and what it said."""

    def __init__(self, chain: Chain) -> None:
        name, vehicle = chain
        services = [each for each in Registry.read(name) if each not in LEFT_OUT]
        super().__init__(
            SCRIPT, services, stack=name, still_s=10.0, overrides=[DEEP], vehicle=vehicle,
            virtual=True,
        )  # fmt: skip
        self.stack.check(known_tables(self.rows))
        self.samples, self.truth = self.heard(topics.IMU), self.heard(topics.TRUTH)
        self.references = self.heard(topics.REFERENCE)
        self.states: list[VehicleState] = []
        self.ahead_ns = list[int]()  # [ns] a state's stamp minus when it was heard
        self.ears().each(topics.STATE, self._see)

    def _see(self, state: VehicleState, now: int) -> None:
        self.states.append(state)
        self.ahead_ns.append(state.stamp_ns - now)


def armed(chain: Chain) -> ChainDive:
    if SIMULATOR not in Registry.read(chain[0]):
        pytest.skip(f"{chain[0]} has no simulator, which alone says what is true")
    try:
        return ChainDive(chain).until_armed()
    except NeedsRealTimeError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def flown() -> Callable[[Chain], ChainDive]:
    @cache
    def fly(chain: Chain) -> ChainDive:
        return armed(chain).run(FLOWN_S)

    return fly


@pytest.fixture
def dive(chain: Chain, flown: Callable[[Chain], ChainDive]) -> ChainDive:
    return flown(chain)


# The estimator.


def test_a_state_is_of_a_sample_of_the_imu_and_newer_than_the_one_before(dive: ChainDive) -> None:
    states, samples = dive.states, dive.samples
    assert {state.sensor_ns for state in states} <= {sample.stamp_ns for sample in samples}
    assert all(np.diff([state.sensor_ns for state in states]) > 0)
    assert len(states) > 0.9 * len(samples)
    assert max(dive.ahead_ns) <= 0


def test_it_calibrates_first_and_then_runs(dive: ChainDive) -> None:
    phases = [state.phase for state in dive.states]
    changes = [now for before, now in zip(["", *phases], phases, strict=False) if now != before]
    assert changes[-1] == "running"
    assert changes.count("running") == 1, changes


def running(dive: ChainDive) -> list[VehicleState]:
    return [state for state in dive.states if state.phase == "running"]


def true(dive: ChainDive, states: list[VehicleState], what: Callable[[Truth], float]) -> Floats:
    """At the instants of the states."""
    truth = dive.truth
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


def test_without_an_imu_the_drone_acts(chain: Chain) -> None:
    """No state, or one of which nothing is valid: then the failsafes see it."""
    dive = armed(chain)
    breaks = dive.host.node("voice", ["topside"]).publisher(topics.FAULT_REQUEST)
    breaks.put(
        FaultRequest(stamp_ns=dive.host.now, id="contract", part="sensor/imu", fault="silent")
    )
    dive.run(LOST_S + 0.1)  # with the way of the request
    assert dive.statuses[-1].failsafe in ("state_lost", "imu_lost")


# The law.


def axes(dive: ChainDive) -> dict[str, list[Motion]]:
    told = [each for each in dive.references if each.armed]
    return {"depth": [each.depth for each in told], "heading": [each.heading for each in told]}


def test_no_plan_was_refused(dive: ChainDive) -> None:
    kind = events.LAW_REFUSED("heave").name.partition(":")[0]
    assert not [name for name in dive.counts if name.partition(":")[0] == kind]


def test_the_reference_is_continuous_and_agrees_with_itself(dive: ChainDive) -> None:
    settings = dive.stack.section("reference", ReferenceSettings)
    told = [each for each in dive.references if each.armed]
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
