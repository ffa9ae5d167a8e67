"""The controller on a busy computer: what is measured counts, and not when it is handled."""

from math import cos, sin

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.control import Wrench
from messages.events import Outbox
from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.state import VehicleState
from services.control.core import LONGEST_NS, Controller, Settings, at_sample
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from tests.support import said
from tests.support.said import state
from tests.support.told import told

MS = 1_000_000  # [ns]
PIONEER = Stack().section("vehicle", Vehicle)
GAINS = Stack().section("control", Settings)


def reference(at: int) -> Reference:
    t = at / 1e9
    swing = Motion(0.2 * sin(t), 0.2 * cos(t), -0.2 * sin(t), -0.2 * cos(t))
    depth = msgspec.structs.replace(swing, position=2.0 + swing.position)
    return said.reference(at, depth=depth, heading=swing, surge_force=3.0)


def late(at: int) -> VehicleState:
    """A vehicle that does what it should, a little late."""
    t = at / 1e9 - 0.1
    rate, angle = 0.2 * cos(t), 0.2 * sin(t)
    return state(
        at, depth=2.0 + angle, depth_rate=rate, depth_acceleration=-angle, heading=angle,
        yaw_rate=rate,
    )  # fmt: skip


def wrenches(steps: list[tuple[int, int]], *, delayed: bool) -> list[Wrench]:
    """Steps of (period, delay) [ms]; a period of 0 is another step with the same sample."""
    law, sensor_ns = Controller(GAINS, PIONEER, Outbox()), 1000 * MS
    said: list[Wrench] = []
    for period, delay in steps:
        sensor_ns += period * MS
        now = sensor_ns + (delay * MS if delayed else 0)
        wrench, _ = law.step(reference(sensor_ns), late(sensor_ns), now)
        said.append(msgspec.structs.replace(wrench, stamp_ns=0))
    return said


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from([0, 10, 10, 10, 20, 40, 100]), st.integers(0, 45)),
        min_size=10,
        max_size=60,
    )
)
def test_handling_delays_change_no_wrench(steps: list[tuple[int, int]]) -> None:
    assert wrenches(steps, delayed=True) == wrenches(steps, delayed=False)


@pytest.mark.parametrize("gap_ms", [10, 300])
def test_a_long_gap_teaches_nothing_and_is_counted_once(gap_ms: int) -> None:
    law, rest = Controller(GAINS, PIONEER, Outbox()), Motion(2.0, 0.0, 0.0, 0.0)
    still = Estimate(0.0, 0.01)

    def step(at: int, rate: float) -> Wrench:
        asked = msgspec.structs.replace(reference(at), depth=rest)
        seen = msgspec.structs.replace(
            state(at), depth=Estimate(2.0, 0.01), depth_rate=Estimate(rate, 0.01), yaw_rate=still
        )
        return law.step(asked, seen, at)[0]

    learnt = [step(k * 10 * MS, 0.0) for k in range(50)][-1].disturbance[2]
    pushed = step((490 + gap_ms) * MS, 0.5).disturbance[2]
    assert (pushed == learnt) == (gap_ms > 50)
    assert told(law.outbox) == (["gap:state"] if gap_ms > 50 else [])


@given(st.integers(0, 10**9), st.integers(-100, 100))
def test_a_reference_is_run_on_to_the_sample_of_the_state(at: int, lead: int) -> None:
    there = at + 10**9 + lead * MS
    ahead, asked = at_sample(reference(at + 10**9), there), reference(there)
    error = 0.2 * (lead / 1e3) ** 4 / 24 + 1e-12  # of the fourth derivative
    assert ahead.depth.position == pytest.approx(asked.depth.position, abs=error)
    assert ahead.heading.position == pytest.approx(asked.heading.position, abs=error)
    assert ahead.depth.velocity == pytest.approx(asked.depth.velocity, abs=2e-4)


def test_a_reference_of_no_sample_or_of_another_clock_stays_as_it_is() -> None:
    asked = reference(10**9)
    assert at_sample(asked, 10**9) is asked
    assert at_sample(asked, 10**9 + LONGEST_NS + 1) is asked
    alone = msgspec.structs.replace(asked, sensor_ns=None)
    assert at_sample(alone, 10**9 + MS) is alone
