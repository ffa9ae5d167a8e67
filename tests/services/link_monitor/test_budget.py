"""The stages add up to the whole, and nothing is said that is not known."""

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from messages.control import ThrusterCommand
from messages.link import DOWN_STAGES, LatencyBudget, Shown
from messages.state import VehicleState
from services.link_monitor.latency_account import LatencyAccount
from tests.support import said

MS, S = 1_000_000, 1_000_000_000
PERIOD = 20 * MS
ways = st.lists(
    st.tuples(*(st.integers(0, 80) for _ in range(5))), min_size=10, max_size=60
)  # [ms] pad, link, reference, control, thruster


def at_rest(sensed: int) -> VehicleState:
    return said.state(sensed + 2 * MS, sensor_ns=sensed)


def fly(budget: LatencyAccount, k: int, way: tuple[int, ...]) -> int:
    """One command from the stick to the thruster. Returns when its telemetry is back."""
    pad, link, reference, control, thruster = way
    sent = k * PERIOD
    budget.command(said.sticks(sent, device_age_ms=pad), sent + MS)
    referred = sent + MS + (link + reference) * MS
    commanded = referred + control * MS
    done = commanded + thruster * MS
    now = done + 10 * MS
    budget.ping(float(link), now)
    budget.reference(said.reference(referred, sensor_ns=None, pilot_ns=sent), now)
    thrust = ThrusterCommand(stamp_ns=commanded, sensor_ns=None, pilot_ns=sent, thrust=())
    budget.thrusters(thrust, now)
    budget.actuation(said.actuation(done, pilot_ns=sent), now)
    return now


@given(ways=ways)
def test_the_stages_add_up_to_the_median_from_end_to_end(ways: list[tuple[int, ...]]) -> None:
    budget = LatencyAccount()
    for _ in range(5):
        budget.ping(0.0, 0)  # before the first answers the link's share is not known
    now = max(fly(budget, k, way) for k, way in enumerate(ways))
    said = budget.report(now, None, ())
    assert said.down is not None
    assert tuple(stage.name for stage in said.down) == DOWN_STAGES
    totals = sorted(pad + 1 + sum(rest) for pad, *rest in ways)
    low, high = (
        totals[len(totals) * 2 // 5 - 1],
        totals[min(len(totals) - 1, len(totals) * 3 // 5 + 1)],
    )
    assert low - 1e-6 <= sum(stage.p50_ms for stage in said.down) <= high + 1e-6
    whole = said.stick_to_thruster_ms or 0.0
    assert whole == totals[len(totals) // 2]
    assert abs(sum(stage.p50_ms for stage in said.down) - whole) <= 0.05 * whole


@given(way=st.tuples(*(st.integers(0, 80) for _ in range(5))))
def test_a_steady_way_is_told_stage_by_stage(way: tuple[int, ...]) -> None:
    budget = LatencyAccount()
    now = [fly(budget, k, way) for k in range(20)][-1]
    said = budget.report(now, 0.1, ())
    assert said.down is not None
    pad, link, reference, control, thruster = way
    wanted = (pad, 1, link, reference, control, thruster)
    assert all(abs(s.p50_ms - ms) < 1e-6 for s, ms in zip(said.down, wanted, strict=True))
    assert abs((said.stick_to_thruster_ms or 0.0) - sum(wanted)) <= 0.05 * sum(wanted)


def test_what_is_old_is_not_said() -> None:
    budget = LatencyAccount()
    now = [fly(budget, k, (1, 1, 1, 1, 1)) for k in range(20)][-1]
    assert budget.report(now, None, ()).down is not None
    later = budget.report(now + 3_000 * MS, None, ())
    assert later.down is None
    assert later.stick_to_thruster_ms is None


def test_the_way_back_adds_up_too_and_is_unknown_without_a_screen() -> None:
    budget = LatencyAccount()
    for k in range(20):
        sensed = k * 10 * MS
        budget.state(at_rest(sensed), sensed + 32 * MS)
    assert budget.report(300 * MS, None, ()).up is None
    for k in range(8):
        budget.shown(Shown(stamp_ns=k * 250 * MS + 50 * MS, sensor_ns=k * 250 * MS), 300 * MS)
    report = budget.report(300 * MS, None, ())
    assert report.up is not None
    assert [round(stage.p50_ms) for stage in report.up] == [2, 30, 18]
    assert report.sensor_to_screen_ms == 50.0


def test_a_command_that_was_held_up_for_longer_than_the_budget_looks_back_is_no_trouble() -> None:
    budget = LatencyAccount()
    for late in (0, 1_000, 2_001, 60_000):
        budget.command(said.sticks(), late * MS)
    assert budget.report(60_000 * MS, None, ()).down is None


@given(error=st.integers(-500, 500), delay=st.integers(0, 400))
def test_two_clocks_that_disagree_give_no_time_below_zero(error: int, delay: int) -> None:
    """`error` [ms] is how far the drone's stamps are off after the clocks were compared."""
    budget, now = LatencyAccount(), 0
    for k in range(20):
        sent = 100 * S + k * PERIOD
        done, now = sent + (delay + error) * MS, sent + 2 * delay * MS
        budget.command(said.sticks(sent), sent)
        budget.ping(float(delay), now)
        for hear, message in (
            (budget.reference, said.reference(done, sensor_ns=None, pilot_ns=sent)),
            (
                budget.thrusters,
                ThrusterCommand(stamp_ns=done, sensor_ns=None, pilot_ns=sent, thrust=()),
            ),
            (budget.actuation, said.actuation(done, pilot_ns=sent)),
            (budget.shown, Shown(stamp_ns=now, sensor_ns=done)),
        ):  # fmt: skip
            hear(message, now)  # type: ignore[operator]
    report = budget.report(now, 500.0, ())
    # Whoever hears it opens it again, and there a time below zero is malformed.
    again = msgspec.msgpack.decode(msgspec.msgpack.encode(report), type=LatencyBudget)
    assert again == report
    assert again.stick_to_thruster_ms is not None


@given(arrivals=st.lists(st.integers(1, 3000), max_size=60), after=st.integers(0, 5000))
def test_lost_is_the_time_in_which_no_state_arrived(arrivals: list[int], after: int) -> None:
    """Also while the pause lasts. A message that another one replaces at once is not missed."""
    budget, now = LatencyAccount(), 0
    assert budget.report(50 * S, None, ()).lost_s == 0.0  # nothing was there yet
    for pause_ms in (0, *arrivals):
        now += pause_ms * MS
        budget.state(at_rest(now), now)
    pauses = [pause for pause in (*arrivals, after) if pause > 500]
    assert round(budget.report(now + after * MS, None, ()).lost_s * 1000) == sum(pauses)
