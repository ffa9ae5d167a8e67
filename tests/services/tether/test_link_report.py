"""What a line says of itself: of each period, its own; and a recorded link, again and again."""

from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.tether.core import Link
from services.tether.delay import Trace
from services.tether.link_model import LinkDirection
from services.tether.loss import Loss, Outage, Outages
from services.tether.profile import DirectionProfile, LinkProfile

MS, SECOND = 1_000_000, 1_000_000_000
period = st.tuples(st.integers(0, 50), st.integers(0, 900))  # messages, bytes of each


def flown(line: LinkDirection[int], begin: int, messages: int, size: int) -> None:
    """One message each 10 ms from `begin` [ns] on; each leaves as soon as it has arrived."""
    for k in range(messages):
        now = begin + k * 10 * MS
        while (due := line.due()) is not None and due <= now:
            line.leave(due)
        line.enter(k, now, size)
    while (due := line.due()) is not None:
        line.leave(due)


@given(st.floats(0.0, 50.0), st.lists(period, min_size=1, max_size=6))
def test_a_report_tells_of_its_own_period(delay_ms: float, periods: list[tuple[int, int]]) -> None:
    line = LinkDirection[int](DirectionProfile(delay_ms=delay_ms), np.random.default_rng(1))
    assert line.report(0).rate_kbit == 0.0
    for k, (messages, size) in enumerate(periods):
        flown(line, k * SECOND, messages, size)
        said = line.report((k + 1) * SECOND)
        assert said.forwarded == sum(count for count, _ in periods[: k + 1])
        assert said.rate_kbit == pytest.approx(messages * size * 8e-3)
        assert (said.loss, said.queued, said.lost) == (0.0 if messages else None, 0, {})
        for percentile in (said.delay_p50_ms, said.delay_p99_ms):
            assert (percentile is None) == (messages == 0)
            assert percentile is None or abs(percentile - delay_ms) < 0.6e-6  # [ms] rounded


@given(st.floats(0.05, 0.9), st.integers(1, 5))
def test_the_loss_of_a_period_is_the_share_of_what_was_settled_in_it(
    share: float, periods: int
) -> None:
    line, lost, before = (
        LinkDirection[int](DirectionProfile(loss=Loss(loss_good=share)), np.random.default_rng(3)),
        0,
        0,
    )
    for k in range(periods):
        flown(line, k * SECOND, 50, 100)
        said = line.report((k + 1) * SECOND)
        lost, before = line.lost.total() - before, line.lost.total()
        assert said.loss == pytest.approx(lost / 50)
        assert said.dropped == line.lost.total() == sum(said.lost.values())


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(1, 800)), min_size=1, max_size=30))
def test_whoever_asks_when_something_is_due_hears_all_as_early_as_whoever_asks_all_the_time(
    entering: list[tuple[int, int]],
) -> None:
    leg = DirectionProfile(delay_ms=3.0, jitter_ms=5.0, rate_kbit=200.0)
    asked, often = (LinkDirection[int](leg, np.random.default_rng(4)) for _ in range(2))
    times: list[list[int]] = [[], []]
    now = 0
    for k, (gap, size) in enumerate(entering):
        for line in (asked, often):
            line.enter(k, now, size)
        then = now + gap * MS
        while (due := asked.due()) is not None and due <= then:
            if asked.leave(due) is not None:
                times[0].append(-(-due // MS))
        for tick in range(now, then + 1, MS):
            while often.leave(tick) is not None:
                times[1].append(tick // MS)
        now = then
    assert times[0] == times[1]


def test_a_schedule_counts_from_the_change_to_it() -> None:
    line = LinkDirection[int](DirectionProfile(), np.random.default_rng(1))
    line.enter(0, 0)
    away = Outages((Outage(start_s=2.0, seconds=1.0),))
    line.change(DirectionProfile(outages=away), 10 * SECOND)
    up = [line.is_up(10 * SECOND + at) for at in range(0, 5 * SECOND, SECOND // 2)]
    assert up == [True] * 4 + [False] * 2 + [True] * 4


@given(
    st.floats(0.0, 100.0),
    st.lists(st.tuples(st.floats(0.01, 0.5), st.none() | st.floats(0.0, 2.0)), min_size=2),
    st.integers(0, 5),
    st.floats(0.01, 0.99),
)
def test_a_trace_is_the_recorded_delays_again_and_again(
    first: float, rows: list[tuple[float, float | None]], round_: int, share: float
) -> None:
    """At each moment that of the row before it; the last row is where it begins anew."""
    sent = tuple(accumulate((step for step, _ in rows), initial=first))
    delays = [*(delay for _, delay in rows), None]
    arrived = tuple(None if d is None else s + d for s, d in zip(sent, delays, strict=True))
    trace = Trace(sent_s=sent, arrived_s=arrived)
    for k, (step, delay) in enumerate(rows):
        moment = sent[k] - first + share * step + round_ * (sent[-1] - first)
        found = trace.at(moment)
        assert found == (None if delay is None else pytest.approx(1e3 * delay, abs=1e-6))


def test_the_round_trip_is_there_and_back() -> None:
    link: Link[int] = Link(
        "slow",
        LinkProfile(down=DirectionProfile(delay_ms=30.0), up=DirectionProfile(delay_ms=50.0)),
        1,
    )
    flown(link.down, 0, 10, 100)
    assert link.status(SECOND, None).rtt_ms is None  # nothing came back yet
    flown(link.down, SECOND, 10, 100)
    flown(link.up, SECOND, 10, 100)
    assert link.status(2 * SECOND, None).rtt_ms == pytest.approx(80.0)


def test_the_two_directions_lose_each_its_own_messages() -> None:
    leg = DirectionProfile(loss=Loss(loss_good=0.3))
    link: Link[int] = Link("lossy", LinkProfile(down=leg, up=leg), 1)
    lost = list[set[int]]()
    for line in (link.down, link.up):
        flown(line, 0, 400, 100)
        lost.append({item for item, _ in line.take_lost()})
    assert all(80 < len(each) < 160 for each in lost)
    # 30 % of 30 % are lost both ways: 36 of 400, less than twice that.
    assert len(lost[0] & lost[1]) < 72
