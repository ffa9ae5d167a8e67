"""What holds for every link, whatever its profile: nothing is invented, nothing vanishes."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.topic import Qos
from services.tether.delay import Pareto, Table, Trace
from services.tether.link_model import LinkDirection
from services.tether.loss import Loss, Outage, Outages
from services.tether.priority_queue import RANK
from services.tether.profile import DirectionProfile, Late, Queue

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


@settings(max_examples=150, deadline=None)
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


@settings(max_examples=100, deadline=None)
@given(legs(), entries)
def test_nothing_comes_early_and_only_the_late_are_overtaken_within_a_stance(
    leg: DirectionProfile, steps: list[tuple[int, int, int]]
) -> None:
    out = passage(line_of(leg), steps)
    times = [at for _, at, _ in out]
    assert times == sorted(times)
    entered = np.cumsum([wait for wait, _, _ in steps]).tolist()
    for item, at, _ in out:
        transmission = 0.0
        if leg.rate_kbit:
            transmission = (steps[item][1] + leg.overhead_bytes) * 8e6 / leg.rate_kbit
        assert at >= entered[item] + leg.delay_ms * MS + transmission - 2
    if leg.late is None:
        for rank in range(4):
            same = [item for item, _, _ in out if steps[item][2] == rank]
            assert same == sorted(same)


@settings(max_examples=100, deadline=None)
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


@settings(max_examples=100, deadline=None)
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


def test_a_change_keeps_what_is_on_the_way() -> None:
    narrow = DirectionProfile(delay_ms=50.0, rate_kbit=80.0, queue=Queue())
    line = line_of(narrow)
    for item in range(20):
        line.enter(item, 0, 100)  # 10 ms each
    line.leave(35 * MS)
    line.change(DirectionProfile(delay_ms=5.0), 35 * MS)
    out = drain(line)
    assert [item for item, _, _ in out] == list(range(20))
    assert line.lost.total() == 0
    line.change(narrow, 1 * S)  # a limit that is smaller than what waits loses nothing either
    for item in range(20):
        line.enter(item, 1 * S, 100)
    line.change(DirectionProfile(rate_kbit=80.0, queue=Queue(limit_bytes=200)), 1 * S)
    assert len(drain(line)) == 20


# Rate, queue, urgency.


def flood(queue: Queue, seconds: float, load: float) -> tuple[LinkDirection[int], list[float]]:
    """`load` times the capacity of 100 kbit/s in messages of 100 B; the delays in ms."""
    line, delays = line_of(DirectionProfile(rate_kbit=100.0, queue=queue)), list[float]()
    step = round(8 * MS / load)
    for k in range(round(seconds * S / step)):
        for item, at, _ in drain(line, k * step):
            delays.append((at - item * step) / MS)
        line.enter(k, k * step, 100)
    return line, delays


def test_drop_oldest_brings_what_is_newer() -> None:
    tail = flood(Queue(limit_bytes=5000), 20.0, 3.0)[1]
    oldest = flood(Queue(limit_bytes=5000, policy="drop_oldest"), 20.0, 3.0)[1]
    assert np.median(oldest) < 0.5 * np.median(tail)


@settings(max_examples=50, deadline=None)
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


# Outages and traces.
