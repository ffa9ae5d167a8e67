"""The moment at which sticks are sent comes to be just before the next step on board."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.link import LatencyBudget, Stage
from services.piloting.sticks import AIM_MS, SETTLED, WORTHWHILE_MS, StickPhase
from tests.support.dive import CHAIN, Dive

TICK_MS, WINDOW = 10.0, 4  # [ms] between two states; budgets of two seconds
STEP_S = 0.5  # [s] between two budgets


def told(waits: list[float]) -> LatencyBudget:
    p50 = sorted(waits)[len(waits) // 2]
    return LatencyBudget(
        stamp_ns=0, up=None, sensor_to_screen_ms=None, stick_to_thruster_ms=p50, bound_ms=0.1,
        down=(Stage("link", 1.0, 1.2), Stage("reference", p50, max(waits))),
    )  # fmt: skip


@given(
    st.floats(0.0, TICK_MS, exclude_max=True),
    st.floats(-100.0, 100.0),
    st.lists(st.floats(-0.3, 0.3), min_size=200, max_size=200),
)
def test_whatever_the_phase_at_first_the_wait_becomes_short_and_stays_so(
    first: float, drift_ppm: float, jitter: list[float]
) -> None:
    """The two clocks drift apart, and the way of each command varies."""
    phase, wait, seen = StickPhase(), first, list[float]()
    for step, more in enumerate(jitter):
        wait = (wait + drift_ppm * 1e-6 * STEP_S * 1e3) % TICK_MS
        seen.append((wait + more) % TICK_MS)
        by = phase.shift(told(seen[-WINDOW:])) / 1e6
        assert abs(by) <= TICK_MS
        wait = (wait - by) % TICK_MS
        if step > 4 * SETTLED:
            assert abs(wait - AIM_MS) <= WORTHWHILE_MS + 1.0


def test_what_is_not_known_moves_nothing() -> None:
    phase = StickPhase()
    unknown = LatencyBudget(
        stamp_ns=0, down=None, up=None, stick_to_thruster_ms=None, sensor_to_screen_ms=None,
        bound_ms=None,
    )  # fmt: skip
    assert [phase.shift(unknown) for _ in range(20)] == [0] * 20


@pytest.mark.slow
def test_in_a_dive_commands_come_just_before_the_next_state() -> None:
    """And their rate stays what it is."""
    dive = Dive("0,0,0,0,0\n40,0,0,0,0\n", (*CHAIN, "link_monitor"))
    sent = dive.heard(topics.PILOT_COMMAND, "topside")
    budgets = dive.heard(topics.LATENCY, "topside")
    dive.run(16.0)
    waits = [s.p50_ms for b in budgets for s in b.down or () if s.name == "reference"]
    assert all(abs(wait - AIM_MS) < 1.0 for wait in waits[-8:])
    recent = [command for command in sent if command.stamp_ns >= sent[-1].stamp_ns - 4_000_000_000]
    assert 49.0 <= len(recent) / 4.0 <= 51.0
