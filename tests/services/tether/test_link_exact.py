"""A link without chance, to the nanosecond: each packet against a formula of its own.

A link of limited rate is a queue with one server (Lindley 1952): a packet is sent from when it
entered or the one before it was sent, whichever is later.
"""

from collections import Counter
from itertools import accumulate

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from messages import events
from services.tether.link_model import LinkDirection
from services.tether.profile import DirectionProfile, Late, Outage, Outages, Queue, Table

US, MS, S = 1_000, 1_000_000, 1_000_000_000  # [ns]
ENDLESS = Queue(limit_bytes=100_000_000)
seconds = st.integers(0, 40).map(lambda tenths: tenths / 10)


def constant(ms: float) -> Table:
    return Table((ms, ms))


@st.composite
def plain(draw: st.DrawFn) -> DirectionProfile:
    """Delay, rate and overhead; nothing else happens to a packet."""
    rate = draw(st.sampled_from([0.0, 0.5, 1.0, 30.0, 800.0, 12_345.0]))
    return DirectionProfile(
        delay_ms=float(draw(st.integers(0, 40))),
        delay=constant(float(draw(st.integers(0, 40)))),
        rate_kbit=rate,
        overhead_bytes=draw(st.integers(0, 60)),
        queue=ENDLESS if rate else None,
    )


# (time since the one before [ns], size [B]): whole microseconds, so that whatever else happens
# can happen between two packets.
entries = st.lists(
    st.tuples(st.integers(0, 20_000).map(lambda us: us * US), st.integers(0, 1500)),
    min_size=1,
    max_size=25,
)
Entered = list[tuple[int, int]]  # when [ns], size [B] with overhead
Sent = list[tuple[int, int, int]]  # from, until, arrives [ns]


def line_of(leg: DirectionProfile) -> LinkDirection[int]:
    return LinkDirection(leg, np.random.default_rng(1))


def entered(leg: DirectionProfile, steps: list[tuple[int, int]], begin: int = 0) -> Entered:
    times = accumulate(wait for wait, _ in steps)
    return [
        (begin + at, size + leg.overhead_bytes) for at, (_, size) in zip(times, steps, strict=True)
    ]


def expected(
    packets: Entered,
    leg: DirectionProfile,
    then: DirectionProfile | None = None,
    changed: int | None = None,
) -> Sent:
    """When each packet is sent and arrives, on a line that is changed to `then` at `changed`."""
    found: Sent = []
    free = last = 0  # [ns] when the line has sent all before, when the last one arrives
    for at, size in packets:
        start = max(at, free)
        here = leg if then is None or changed is None or start < changed else then
        free = end = start + (round(size * 8e6 / here.rate_kbit) if here.rate_kbit else 0)
        if then is not None and changed is not None and end > changed:
            here = then
            if at < changed and not then.rate_kbit:
                free = end = changed  # what waits is sent at once
        assert isinstance(here.delay, Table)
        last = max(last, end + round((here.delay_ms + here.delay.ms[0]) * MS))
        found.append((start, end, last))
    return found


def out_of(line: LinkDirection[int], until: int | None = None) -> list[tuple[int, int]]:
    """Each item that arrives, and when [ns]."""
    out: list[tuple[int, int]] = []
    while (due := line.due()) is not None and (until is None or due <= until):
        while (arrival := line.leave(due)) is not None:
            assert not arrival.damaged
            out.append((arrival.item, due))
    return out


def enter_all(line: LinkDirection[int], leg: DirectionProfile, packets: Entered) -> None:
    for item, (at, size) in enumerate(packets):
        line.enter(item, at, size - leg.overhead_bytes)


def arrivals(sent: Sent) -> list[tuple[int, int]]:
    return [(item, arrives) for item, (_, _, arrives) in enumerate(sent)]


@given(plain(), entries)
def test_a_packet_waits_is_sent_at_the_rate_and_arrives_after_the_delay(
    leg: DirectionProfile, steps: list[tuple[int, int]]
) -> None:
    line, packets = line_of(leg), entered(leg, steps)
    sent = expected(packets, leg)
    enter_all(line, leg, packets)
    assert out_of(line) == arrivals(sent)
    assert line.carried_bytes == sum(size for _, size in packets)
    said = line.report(sent[-1][2])
    assert (said.rate_kbit, said.forwarded, said.loss) == (0.0, len(packets), 0.0)
    delays = sorted(arrives - at for (at, _), (_, _, arrives) in zip(packets, sent, strict=True))
    assert said.delay_p50_ms == delays[len(delays) // 2] / MS


@given(plain(), entries, plain(), st.integers(0, 300_000))
def test_a_change_counts_for_what_is_not_yet_sent(
    leg: DirectionProfile, steps: list[tuple[int, int]], then: DirectionProfile, changed_us: int
) -> None:
    """A packet that is being sent ends at the old rate, unless the new one has no limit."""
    line, packets = line_of(leg), entered(leg, steps)
    changed = changed_us * US + US // 2
    enter_all(line, leg, [packet for packet in packets if packet[0] < changed])
    line.change(then, changed)
    later = [(at, size - leg.overhead_bytes + then.overhead_bytes) for at, size in packets]
    packets = [old if old[0] < changed else new for old, new in zip(packets, later, strict=True)]
    for item, (at, size) in enumerate(packets):
        if at >= changed:
            line.enter(item, at, size - then.overhead_bytes)
    assert out_of(line) == arrivals(expected(packets, leg, then, changed))
    assert line.carried_bytes == sum(size for _, size in packets)


@given(plain(), entries, st.integers(0, 300_000), st.integers(0, 300_000), entries)
def test_a_cut_names_what_did_not_arrive_and_the_line_is_then_as_new(
    leg: DirectionProfile,
    steps: list[tuple[int, int]],
    cut_us: int,
    away_us: int,
    after: list[tuple[int, int]],
) -> None:
    line, packets = line_of(leg), entered(leg, steps)
    cut, back = cut_us * US + US // 2, (cut_us + away_us) * US + US // 2
    before = [packet for packet in packets if packet[0] < cut]
    sent = expected(before, leg)
    enter_all(line, leg, before)
    there = [item for item, _ in out_of(line, cut)]
    assert there == [item for item, arrives in arrivals(sent) if arrives <= cut]
    line.cut(cut)
    assert (line.on_the_way, line.due(), line.is_up(cut)) == (0, None, False)
    carried = sum(size for (_, size), (_, end, _) in zip(before, sent, strict=True) if end <= cut)
    assert line.carried_bytes == carried
    for item, (at, size) in enumerate(packets):
        if cut < at < back:
            line.enter(item, at, size - leg.overhead_bytes)
    gone = {item for item, (at, _) in enumerate(packets) if at < back} - set(there)
    assert Counter(line.take_lost()) == Counter((item, events.OUTAGE) for item in gone)
    assert line.lost == ({"outage": len(gone)} if gone else {})
    line.restore(back)
    assert line.is_up(back)
    again = entered(leg, after, back + 10 * S)  # later than any arrival there could have been
    enter_all(line, leg, again)
    assert out_of(line) == arrivals(expected(again, leg))
    assert line.carried_bytes == carried + sum(size for _, size in again)


@given(plain(), st.lists(st.tuples(st.integers(0, 50_000), st.integers(0, 5000)), max_size=40))
def test_the_rate_is_what_was_carried_while_busy(
    leg: DirectionProfile, steps: list[tuple[int, int]]
) -> None:
    """Whenever one looks: a packet counts, and its time, when it has been sent."""
    line = line_of(leg)
    for item, (at, size) in enumerate(entered(leg, steps)):
        line.enter(item, at, size)
        ideal = line.carried_bytes * 8e6 / leg.rate_kbit if leg.rate_kbit else 0.0
        assert abs(line.busy_ns - ideal) <= item + 1


@given(plain(), entries, st.integers(1, 100))
def test_the_late_arrive_that_much_later_and_hold_up_nobody(
    leg: DirectionProfile, steps: list[tuple[int, int]], ms: int
) -> None:
    late = DirectionProfile(
        delay_ms=leg.delay_ms, delay=leg.delay, rate_kbit=leg.rate_kbit, queue=leg.queue,
        overhead_bytes=leg.overhead_bytes, late=Late(1.0, float(ms)),
    )  # fmt: skip
    line, packets = line_of(late), entered(leg, steps)
    enter_all(line, leg, packets)
    on_time = arrivals(expected(packets, leg))
    assert sorted(out_of(line)) == [(item, arrives + ms * MS) for item, arrives in on_time]


@given(
    st.lists(st.tuples(seconds, st.integers(1, 10)), max_size=3),
    st.booleans(),
    st.integers(0, 3000).map(lambda ms: ms + 0.25),
    st.integers(0, 10**6),
    st.lists(st.integers(0, 9_000), min_size=1, max_size=20),
)
def test_lost_in_an_outage_is_who_is_on_the_way_in_it(
    windows: list[tuple[float, int]], repeats: bool, delay_ms: float, begin: int, at_ms: list[int]
) -> None:
    """The schedule counts from the first message; before it there is none to lose, but the line
    says what is to come."""
    ends = list(accumulate(gap + length / 10 for gap, length in windows))
    away = [(round(end * 1e3) - length * 100, round(end * 1e3)) for end, (_, length) in
            zip(ends, windows, strict=True)]  # fmt: skip
    away = [(since, until) for since, until in away if until <= 6000]
    schedule = Outages(
        tuple(Outage(since / 1e3, (until - since) / 1e3) for since, until in away),
        repeat_s=6.0 if repeats and away else 0.0,
    )
    line = line_of(DirectionProfile(delay_ms=delay_ms, outages=schedule))
    rounds = [0, 6000, 12_000] if schedule.repeat_s else [0]
    spans = [(since + more, until + more) for more in rounds for since, until in away]

    def meets(since: float, until: float) -> bool:
        return any(a < until and since < b for a, b in spans)

    assert line.is_up(begin) == (not meets(0, 0.5))
    times = [0, *(ms + 0.5 for ms in sorted(at_ms))]  # [ms] never at the edge of an outage
    for item, ms in enumerate(times):
        line.enter(item, begin + round(ms * MS))
    lost = [item for item, ms in enumerate(times) if meets(ms, ms + delay_ms)]
    assert line.take_lost() == [(item, events.OUTAGE) for item in lost]
    assert sorted(item for item, _ in out_of(line)) == sorted(set(range(len(times))) - {*lost})
    for ms in times[1:]:
        assert line.is_up(begin + round(ms * MS)) == (not meets(ms, ms))


@given(
    plain(),
    st.lists(st.tuples(st.integers(0, 50_000), st.sampled_from("eeecr"), st.integers(0, 500))),
    plain(),
)
def test_time_does_not_run_backwards(
    leg: DirectionProfile, calls: list[tuple[int, str, int]], other: DirectionProfile
) -> None:
    """What is told of a time before the latest one happens at the latest one."""
    told, latest = line_of(leg), line_of(leg)
    now = 0
    for item, (moment, what, size) in enumerate(calls):
        now = max(now, moment * US)
        for line, at in ((told, moment * US), (latest, now)):
            if what == "e":
                line.enter(item, at, size)
            elif what == "r":
                line.restore(at)
            elif size % 2:
                line.cut(at)
            else:
                line.change(other, at)
    assert told.take_lost() == latest.take_lost()
    assert out_of(told) == out_of(latest)
