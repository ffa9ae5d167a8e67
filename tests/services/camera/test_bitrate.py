"""Laws of the bitrate: within its limits, below the room, down at once, back soon."""

from hypothesis import given
from hypothesis import strategies as st

from messages.link import Stage
from messages.units import Ns
from messages.video import PictureAge
from services.camera.bitrate import SHARE, BitrateLaw
from services.camera.pacing import (
    BURST_NS,
    LARGEST,
    Pacer,
    encoder_kbit,
    pictures_per_second,
    split,
)

S = 1_000_000_000
PERIOD = S // 5
LEAST, MOST = 16.0, 2000.0


def report(
    now: Ns, room: float | None, *, way: float = 20.0, lost: float = 0.0, heard: float = 100.0
) -> PictureAge:
    stages = (Stage("crossed", way, way),) if heard else None
    return PictureAge(
        stamp_ns=now, stages=stages, per_second=20.0 if heard else 0.0, heard_kbit=heard,
        room_kbit=room, lost=lost, newest=now // PERIOD,
    )  # fmt: skip


def law() -> BitrateLaw:
    return BitrateLaw(LEAST, MOST)


def settled(room: float, seconds: float = 4.0) -> tuple[BitrateLaw, Ns]:
    rate, now = law(), 0
    while now < seconds * S:
        now += PERIOD
        rate.heard(report(now, room), now)
    return rate, now


reports = st.lists(
    st.tuples(
        st.one_of(st.none(), st.floats(0.0, 1e6)),  # room
        st.floats(0.0, 5000.0),  # way
        st.floats(0.0, 1.0),  # lost
        st.sampled_from([0.0, 50.0, 1e9]),  # heard
        st.integers(0, 3 * S),  # until the next
    ),
    max_size=40,
)


@given(reports)
def test_it_stays_within_its_limits(history: list[tuple[float | None, float, float, float, int]]):
    rate, now = law(), 0
    for room, way, lost, heard, gap in history:
        rate.heard(report(now, room, way=way, lost=lost, heard=heard), now)
        rate.sent(now)
        now += gap
        assert LEAST <= rate.budget(now) <= MOST


@given(st.floats(30.0, 1e6))
def test_it_settles_below_the_room_with_headroom(room: float) -> None:
    rate, now = settled(room)
    assert rate.budget(now) == min(MOST, SHARE * room)


@given(st.floats(30.0, 5000.0), st.floats(1.0, 10.0))
def test_more_room_is_never_less_bitrate(room: float, more: float) -> None:
    less, now = settled(room)
    greater, _ = settled(more * room)
    assert greater.budget(now) >= less.budget(now)


@given(st.floats(30.0, 1000.0))
def test_a_smaller_room_is_obeyed_within_two_seconds(room: float) -> None:
    rate, now = settled(1e5)
    end = now + 2 * S
    while now < end:
        now += PERIOD
        rate.heard(report(now, room), now)
    assert rate.budget(now) <= SHARE * room


def test_it_comes_back_within_four_seconds_of_a_better_link() -> None:
    rate, now = settled(20.0)
    assert rate.budget(now) == LEAST
    end = now + 4 * S
    while now < end:
        now += PERIOD
        rate.heard(report(now, 1e5), now)
    assert rate.budget(now) == MOST


def test_a_longer_way_is_a_queue_and_cuts_the_bitrate() -> None:
    rate, now = settled(1e5)
    for _ in range(3):
        now += PERIOD
        rate.heard(report(now, 1e5, way=400.0), now)
    assert rate.budget(now) < 0.3 * MOST


def test_a_way_that_stays_long_is_that_of_another_link() -> None:
    rate, now = settled(1e5)
    for _ in range(60):
        now += PERIOD
        rate.heard(report(now, 1e5, way=400.0), now)
    assert rate.budget(now) == MOST


def test_pictures_that_never_arrive_are_fewer_within_two_seconds() -> None:
    rate, now = settled(1e5)
    for _ in range(10):
        now += PERIOD
        rate.sent(now)
        rate.heard(report(now, None, heard=0.0), now)
    assert rate.budget(now) == LEAST


def test_a_slide_show_is_not_taken_for_an_outage() -> None:
    """Between two of its pictures there are reports in which nothing arrived."""
    rate, now = settled(25.0)
    before = rate.budget(now)
    for k in range(40):
        now += PERIOD
        if k % 5 == 0:
            rate.sent(now)
        rate.heard(report(now, 25.0, heard=0.0 if k % 5 != 1 else 50.0), now)
    assert rate.budget(now) >= before


def test_without_anybody_topside_it_fades_to_the_least() -> None:
    rate, now = settled(1e5)
    steps = [rate.budget(now + k * S // 4) for k in range(60)]
    assert steps == sorted(steps, reverse=True)
    assert steps[-1] == LEAST


# What is sent of a budget.


@given(
    st.lists(st.integers(50, 40_000), min_size=1, max_size=80),
    st.floats(LEAST, MOST),
)
def test_no_more_is_sent_than_the_bitrate_allows(sizes: list[int], kbit: float) -> None:
    """Whatever sizes an encoder makes of its pictures: over any time, but for one picture."""
    pacer, sent, hz = Pacer(), list[tuple[Ns, int]](), pictures_per_second(kbit, 25.0)
    now = 0
    for size in sizes:
        while not pacer.admits(now, hz):
            now += S // 25
        pacer.sent(size, kbit, hz, keyframe=False, now=now)
        sent.append((now, size))
        now += S // 25
    for first, (began, _) in enumerate(sent):
        total = 0
        for at, size in sent[first:]:
            allowed = ((at - began) + 2 * BURST_NS) * kbit / 8e6
            assert total <= allowed + 1.0
            total += size


@given(st.floats(1.0, 60.0), st.floats(2.0, 60.0))
def test_pictures_come_as_often_as_wanted(hz: float, camera_hz: float) -> None:
    pacer, sent = Pacer(), 0
    for k in range(400):
        now = round(k * S / camera_hz)
        if pacer.admits(now, hz):
            pacer.sent(1, 1e6, hz, keyframe=False, now=now)
            sent += 1
    seconds = 400 / camera_hz
    assert sent <= min(hz, camera_hz) * seconds + 2
    assert sent >= 0.45 * min(hz, camera_hz) * seconds - 1


@given(st.integers(0, 50_000), st.floats(1.0, 1e6))
def test_parts_are_the_access_unit_and_none_is_long(size: int, room: float) -> None:
    data = bytes(k % 251 for k in range(256)) * (size // 256) + bytes(size % 256)
    parts = split(data, room)
    assert b"".join(parts) == data
    assert all(0 < len(part) <= LARGEST for part in parts)


@given(st.floats(LEAST, MOST), st.floats(0.0, MOST))
def test_the_encoder_is_never_asked_for_more_than_the_budget(budget: float, before: float) -> None:
    chosen = encoder_kbit(budget, before)
    assert 0.7 * budget < chosen <= budget * (1.0 + 1e-9)
    assert encoder_kbit(budget, chosen) == chosen  # it keeps what it has
