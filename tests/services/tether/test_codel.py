"""CoDel keeps the control law of RFC 8289, whatever waits in the queue."""

from math import sqrt

from hypothesis import given
from hypothesis import strategies as st

from services.tether.codel import CoDel, Dropper

MS = 1_000_000  # [ns]


def codel(target_ms: float, more_ms: float) -> CoDel:
    return CoDel(target_ms, target_ms + more_ms)


laws = st.builds(codel, st.floats(1.0, 20.0), st.floats(0.0, 200.0))
leaving = st.tuples(
    st.integers(0, 30 * MS),  # [ns] since the message before
    st.sampled_from([0.0, 0.99, 1.0, 3.0]),  # [-] of the target that it waited
    st.sampled_from([False, False, False, True]),  # alone
)


def ns(milliseconds: float) -> int:
    return round(milliseconds * MS)


def dropped(law: CoDel, dropper: Dropper, begin: int, seconds: float) -> list[int]:
    """[ns] Of the drops while everything waits too long; a message would leave each 0.1 ms."""
    times = range(begin, begin + round(seconds * 1e9), MS // 10)
    return [now for now in times if dropper.drops(2 * ns(law.target_ms), False, now)]


@given(laws, st.lists(leaving, max_size=200))
def test_nothing_is_dropped_before_an_interval_of_waits_that_were_all_too_long(
    law: CoDel, queue: list[tuple[int, float, bool]]
) -> None:
    dropper, now, since = Dropper(law), 5 * MS, None
    for gap, share, alone in queue:
        now += gap
        too_long = share >= 1.0 and not alone
        if not too_long:
            since = None
        elif since is None:
            since = now
        lasted = since is not None and now > since and now - since >= ns(law.interval_ms)
        dropping = dropper.drops(round(share * ns(law.target_ms)), alone, now)
        assert lasted or not dropping


@given(laws, st.integers(0, 1000 * MS))
def test_drops_come_ever_faster_as_the_root_of_their_number(law: CoDel, begin: int) -> None:
    """The first after one interval; the k-th and the next one are interval / √k apart."""
    drops = dropped(law, Dropper(law), begin, 8 * law.interval_ms / 1e3)
    step, due = MS // 10, begin + ns(law.interval_ms)
    assert len(drops) > 10
    for k, at in enumerate(drops, 1):
        assert 0 <= at - due <= step + 10  # [ns] the next message after it was due
        due = (at if k == 1 else due) + ns(law.interval_ms) / sqrt(k)


@given(laws)
def test_a_message_alone_or_a_short_wait_ends_dropping_and_the_interval_begins_anew(
    law: CoDel,
) -> None:
    for waited, alone in ((2 * ns(law.target_ms), True), (ns(law.target_ms) - 1, False)):
        dropper = Dropper(law)
        last = dropped(law, dropper, 0, 4 * law.interval_ms / 1e3)[-1]
        begin = last + MS // 10
        assert not dropper.drops(waited, alone, begin)
        again = dropped(law, dropper, begin + 1, 2 * law.interval_ms / 1e3)
        assert 0 <= again[0] - begin - 1 - ns(law.interval_ms) <= MS // 10


@given(laws, st.floats(0.1, 40.0) | st.floats(14.0, 18.0))
def test_soon_after_it_goes_on_at_the_rate_found_then_and_later_it_begins_slowly(
    law: CoDel, pause: float
) -> None:
    """`pause` [intervals] is the time until waits are too long again."""
    dropper = Dropper(law)
    first = dropped(law, dropper, 0, 6 * law.interval_ms / 1e3)
    end = first[-1] + MS // 10
    due = first[0] + sum(ns(law.interval_ms) / sqrt(k) for k in range(1, len(first) + 1))
    dropper.drops(0, False, end)
    begin = end + round(pause * ns(law.interval_ms))
    again = dropped(law, dropper, begin, 3 * law.interval_ms / 1e3)
    since = (again[0] - due) / ns(law.interval_ms)  # from the next drop that was due
    gap = (again[1] - again[0]) / ns(law.interval_ms)
    rounding = 0.11 * MS / ns(law.interval_ms)  # a message would leave each 0.1 ms
    expected = 1.0 if since >= 16.0 else 1.0 / sqrt(len(first) - 1)
    assert abs(gap - expected) <= rounding or abs(since - 16.0) < 0.1
