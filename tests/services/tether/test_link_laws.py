"""What holds for every link, whatever its profile: nothing is invented, nothing vanishes; and what
a line says of itself."""

from collections import Counter
from itertools import accumulate

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from messages import events
from messages.topic import Qos
from services.tether.core import Link
from services.tether.link_model import RANK, LinkDirection
from services.tether.profile import (
    DirectionProfile,
    Late,
    LinkProfile,
    Loss,
    Outage,
    Outages,
    Pareto,
    Queue,
    Table,
    Trace,
)

MS = 1_000_000  # [ns]
S = 1000 * MS
share = st.floats(0.0, 1.0)
ms = st.floats(0.0, 200.0)

DELAYS = st.one_of(
    st.builds(Pareto, ms, st.floats(1.1, 5.0)),
    st.builds(Table, st.lists(ms, min_size=2, max_size=9).map(tuple)),
    st.just(Trace(sent_s=(0.0, 0.1, 0.3), arrived_s=(0.05, None, 0.4))),
)
LOSSES = st.builds(Loss, share, st.floats(0.05, 1.0), share, share)
OUTAGES = st.sampled_from(
    [
        Outages(),
        Outages((Outage(0.2, 0.1),)),
        Outages((Outage(0.0, 0.05), Outage(0.3, 0.2)), repeat_s=0.6),
    ]
)
QUEUES = st.builds(
    Queue,
    st.integers(100, 20_000),
    st.sampled_from(["drop_tail", "drop_oldest"]),
)


@st.composite
def legs(draw: st.DrawFn) -> DirectionProfile:
    rate = draw(st.sampled_from([0.0, 20.0, 200.0, 5000.0]))
    return DirectionProfile(
        delay_ms=draw(ms),
        delay=draw(DELAYS),
        loss=draw(LOSSES),
        late=draw(st.one_of(st.none(), st.builds(Late, share, ms))),
        duplicate=draw(share),
        corrupt=draw(share),
        rate_kbit=rate,
        overhead_bytes=draw(st.integers(0, 100)),
        queue=draw(QUEUES) if rate else None,
        outages=draw(OUTAGES),
    )


entries = st.lists(
    st.tuples(st.integers(0, 30 * MS), st.integers(0, 1500), st.integers(0, 3)),
    min_size=1,
    max_size=60,
)  # time since the one before, size, rank
Arrived = list[tuple[int, int, bool]]  # item, out [ns], damaged


def line_of(leg: DirectionProfile, seed: int = 1) -> LinkDirection[int]:
    return LinkDirection(leg, np.random.default_rng(seed))


def drain(line: LinkDirection[int], until: int | None = None) -> Arrived:
    """Let everything happen at its own time."""
    out: Arrived = []
    while (due := line.due()) is not None and (until is None or due <= until):
        while (arrival := line.leave(due)) is not None:
            out.append((arrival.item, due, arrival.damaged))
    return out


def passage(line: LinkDirection[int], steps: list[tuple[int, int, int]]) -> Arrived:
    now, out = 0, Arrived()
    for item, (wait, size, rank) in enumerate(steps):
        now += wait
        out += drain(line, now)
        line.enter(item, now, size, rank)
    return out + drain(line)


def assert_conserved(line: LinkDirection[int]) -> None:
    gone = line.forwarded + line.lost.total()
    assert line.entered + line.copied == gone + line.on_the_way


@settings(max_examples=150)
@given(legs(), entries, st.integers(0, 5))
def test_whatever_enters_arrives_is_lost_for_a_reason_or_is_on_the_way(
    leg: DirectionProfile, steps: list[tuple[int, int, int]], seed: int
) -> None:
    line = line_of(leg, seed)
    out = passage(line, steps)
    lost = line.take_lost()
    assert_conserved(line)
    assert line.on_the_way == 0
    assert Counter(reason.name for _, reason in lost) == line.lost
    copies = Counter(item for item, _, _ in out)
    fates = copies + Counter(item for item, _ in lost)
    assert fates.keys() == set(range(len(steps)))  # nobody is forgotten, nobody invented
    assert not copies.keys() & {item for item, _ in lost}
    assert max(copies.values(), default=0) <= 2


@given(legs(), entries)
def test_nothing_comes_early_and_only_the_late_are_overtaken_within_a_rank(
    leg: DirectionProfile, steps: list[tuple[int, int, int]]
) -> None:
    out = passage(line_of(leg), steps)
    entered = np.cumsum([wait for wait, _, _ in steps]).tolist()
    for item, at, _ in out:
        sent = (steps[item][1] + leg.overhead_bytes) * 8e6 / leg.rate_kbit if leg.rate_kbit else 0.0
        assert at >= entered[item] + leg.delay_ms * MS + sent - 2
    for rank in range(4) if leg.late is None else ():
        same = [item for item, _, _ in out if steps[item][2] == rank]
        assert same == sorted(same)


@settings(max_examples=100)
@given(legs(), entries, st.integers(1, 7), st.integers(0, 9))
def test_the_same_seed_gives_the_same_fates_however_often_one_looks(
    leg: DirectionProfile, steps: list[tuple[int, int, int]], look_ms: int, seed: int
) -> None:
    once, often = line_of(leg, seed), line_of(leg, seed)
    expected = passage(once, steps)
    now, out, end = 0, Arrived(), 0
    for item, (wait, size, rank) in enumerate(steps):
        for moment in range(now, now + wait, look_ms * MS):
            out += drain(often, moment)
            often.report(moment)  # looking must not change what happens
        now += wait
        out += drain(often, now)
        often.enter(item, now, size, rank)
        end = now
    assert out + drain(often) == expected
    assert often.take_lost() == once.take_lost()
    assert end == sum(wait for wait, _, _ in steps)


@settings(max_examples=100)
@given(
    st.lists(legs(), min_size=1, max_size=3),
    st.lists(
        st.tuples(st.integers(0, 40 * MS), st.sampled_from("eeeeeelcdu"), st.integers(0, 999)),
        max_size=80,
    ),
)
def test_conservation_survives_changes_cuts_and_joins(
    models: list[DirectionProfile], steps: list[tuple[int, str, int]]
) -> None:
    line, now = line_of(models[0]), 0
    for number, (wait, what, size) in enumerate(steps):
        now += wait
        match what:
            case "e":
                line.enter(number, now, size, number % 4)
            case "l":
                line.leave(now)
            case "c":
                before = line.lost.total(), line.on_the_way
                forwarded = line.forwarded
                line.change(models[number % len(models)], now)
                assert line.forwarded == forwarded
                assert before[1] > 0 or line.lost.total() == before[0]
            case "d":
                line.cut(now)
                assert line.on_the_way == 0
                assert not line.is_up(now)
            case _:
                line.restore(now)
        assert_conserved(line)
    drain(line)
    assert_conserved(line)
    assert line.on_the_way == 0


def test_a_change_to_a_limit_smaller_than_what_waits_loses_nothing() -> None:
    line = line_of(DirectionProfile(delay_ms=50.0, rate_kbit=80.0, queue=Queue()))
    for item in range(20):
        line.enter(item, 1 * S, 100)
    line.change(DirectionProfile(rate_kbit=80.0, queue=Queue(limit_bytes=200)), 1 * S)
    assert len(drain(line)) == 20


# Rate, queue, urgency.


@given(st.integers(1, 200), st.integers(0, 30 * MS))
def test_a_command_waits_for_one_message_at_most(backlog: int, at: int) -> None:
    line = line_of(DirectionProfile(rate_kbit=100.0, queue=Queue()))
    for item in range(backlog):
        line.enter(item, 0, 100, RANK[Qos.BULK])
    out = drain(line, at)
    line.enter(-1, at, 100, RANK[Qos.REALTIME])
    out += drain(line)
    arrived = next(when for item, when, _ in out if item == -1)
    assert arrived - at <= 2 * 8 * MS


@pytest.mark.parametrize(("policy", "kept"), [("drop_tail", [0, 1]), ("drop_oldest", [0, 4])])
def test_a_full_queue_keeps_its_oldest_or_its_newest(policy: str, kept: list[int]) -> None:
    queue = Queue(limit_bytes=100, policy=policy)  # type: ignore[arg-type]
    line = line_of(DirectionProfile(rate_kbit=1.0, queue=queue))
    for item in range(5):
        line.enter(item, 0, 100)
    assert [item for item, _, _ in drain(line)] == kept


@pytest.mark.parametrize("policy", ["drop_tail", "drop_oldest"])
def test_a_full_queue_gives_up_bulk_first_and_commands_last(policy: str) -> None:
    queue = Queue(limit_bytes=1000, policy=policy)  # type: ignore[arg-type]
    line = line_of(DirectionProfile(rate_kbit=1.0, queue=queue))
    for qos in (Qos.BULK, Qos.LIVE, Qos.EVENT, Qos.REALTIME):
        for item in range(5):
            line.enter(10 * RANK[qos] + item, 0, 100, RANK[qos])
    ranks = [item // 10 for item, _ in line.take_lost()]
    bulk, live = RANK[Qos.BULK], RANK[Qos.LIVE]
    assert ranks == [bulk] * 4 + [live] * 5  # one bulk message was leaving already


def test_memory_is_bounded_however_much_enters() -> None:
    line = LinkDirection[int](
        DirectionProfile(delay_ms=60_000.0), np.random.default_rng(1), most=100
    )
    for k in range(1000):
        line.enter(k, k)
    assert line.on_the_way == 100
    assert line.lost == {"too_many": 900}
    assert len(line.take_lost()) == 900
    assert line.take_lost() == []


# None is sent after its life.


LIFE = 400 * MS
SLOW = DirectionProfile(delay_ms=30.0, rate_kbit=100.0, queue=Queue(limit_bytes=50_000))


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(100, 5000)), min_size=1, max_size=60))
def test_each_is_sent_in_its_life_or_counted(entered: list[tuple[int, int]]) -> None:
    line, now, times, out = line_of(SLOW), 0, list[int](), Arrived()
    for number, (gap, size) in enumerate(entered):
        now += gap * MS
        out += drain(line, now)
        times.append(now)
        line.enter(number, now, size, RANK[Qos.BULK], LIFE)
    out += drain(line)
    for number, at, _ in out:
        to_send = entered[number][1] * 8e6 / SLOW.rate_kbit
        assert at <= times[number] + LIFE + to_send + 30 * MS + 1
    assert len(out) + line.lost[events.NO_ROOM.name] == len(entered)


# What a line says of itself: of each period, its own.


def flown(line: LinkDirection[int], begin: int, messages: int, size: int) -> list[float]:
    """One message each 10 ms from `begin` [ns] on. [ms] How long each that arrives took."""
    out = Arrived()
    for k in range(messages):
        out += drain(line, begin + k * 10 * MS)
        line.enter(k, begin + k * 10 * MS, size)
    return [(at - begin) / MS - item * 10.0 for item, at, _ in out + drain(line)]


@given(
    st.floats(0.0, 50.0),
    st.lists(st.tuples(st.integers(0, 50), st.integers(0, 900)), min_size=1, max_size=6),
)
def test_a_report_tells_of_its_own_period(delay_ms: float, periods: list[tuple[int, int]]) -> None:
    """Messages and bytes of each."""
    line = line_of(DirectionProfile(delay_ms=delay_ms, delay=Table((0.0, 9.0))))
    assert line.report(0).rate_kbit == 0.0  # no period ended before
    for k, (messages, size) in enumerate(periods):
        delays = sorted(flown(line, k * S, messages, size))
        said = line.report((k + 1) * S, {"state": 5.0})
        assert said.forwarded == sum(count for count, _ in periods[: k + 1])
        assert said.rate_kbit == pytest.approx(messages * size * 8e-3)
        assert (said.loss, said.queued, said.lost) == (0.0 if messages else None, 0, {})
        assert said.tiers == {"state": 5.0}
        for found, percent in ((said.delay_p50_ms, 50), (said.delay_p99_ms, 99)):
            expected = delays[messages * percent // 100] if messages else None
            assert found == (expected if expected is None else pytest.approx(expected, abs=1e-5))


@given(st.floats(0.05, 0.9), st.integers(1, 5))
def test_the_loss_of_a_period_is_the_share_of_what_it_settled(share: float, periods: int) -> None:
    line, before = line_of(DirectionProfile(loss=Loss(loss_good=share)), seed=3), 0
    for k in range(periods):
        flown(line, k * S, 50, 100)
        said, total = line.report((k + 1) * S), line.lost.total()
        assert said.loss == pytest.approx((total - before) / 50)
        assert said.dropped == total == sum(said.lost.values())
        before = total


def test_a_schedule_counts_from_the_change_to_it() -> None:
    line = line_of(DirectionProfile())
    line.enter(0, 0)
    away = Outages((Outage(start_s=2.0, seconds=1.0),))
    line.change(DirectionProfile(outages=away), 10 * S)
    up = [line.is_up(10 * S + at) for at in range(0, 5 * S, S // 2)]
    assert up == [True] * 4 + [False] * 2 + [True] * 4


@given(
    st.floats(0.0, 100.0),
    st.lists(st.tuples(st.floats(0.01, 0.5), st.none() | st.floats(0.0, 2.0)), min_size=2),
    st.integers(0, 5),
    st.floats(0.01, 0.99),
)
@example(0.0, [(0.2, 0.1), (0.2, None)], 1, 0.5)
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
    down, up = DirectionProfile(delay_ms=30.0), DirectionProfile(delay_ms=50.0)
    link: Link[int] = Link("slow", LinkProfile(down=down, up=up), 1)
    flown(link.down, 0, 10, 100)
    assert link.status(S, None).rtt_ms is None  # nothing came back yet
    flown(link.down, S, 10, 100)
    flown(link.up, S, 10, 100)
    assert link.status(2 * S, None).rtt_ms == pytest.approx(80.0)


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
