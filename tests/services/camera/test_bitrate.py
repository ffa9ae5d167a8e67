"""Laws of the bitrate: within its limits, below the room, down at once, back soon."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.link import Stage
from messages.units import Ns
from messages.video import PictureAge
from services.camera.bitrate import BitrateLaw
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


def test_it_comes_back_within_four_seconds_of_a_better_link() -> None:
    rate, now = settled(18.0)
    assert rate.budget(now) == LEAST
    end = now + 4 * S
    while now < end:
        now += PERIOD
        rate.heard(report(now, 1e5), now)
    assert rate.budget(now) == MOST


def test_a_way_that_stays_longer_is_a_queue_and_cuts_the_bitrate() -> None:
    rate, now = settled(1e5)
    for _ in range(10):
        now += PERIOD
        rate.heard(report(now, 1e5, way=400.0), now)
    assert rate.budget(now) < 0.3 * MOST


def test_a_burst_of_something_else_is_no_queue() -> None:
    rate, now = settled(1e5)
    for k in range(100):
        now += PERIOD
        rate.heard(report(now, 1e5, way=20.0 if k % 4 == 0 else 200.0), now)
        assert rate.budget(now) == MOST


def test_a_way_that_stays_long_is_in_the_end_that_of_another_link() -> None:
    rate, now = settled(1e5)
    for _ in range(5 * 90):
        now += PERIOD
        rate.heard(report(now, 1e5, way=400.0), now)
    assert rate.budget(now) == MOST


def test_pictures_that_never_arrive_are_fewer_within_two_seconds() -> None:
    rate, now = settled(1e5)
    for _ in range(10):
        now += PERIOD
        rate.sent(now)
        rate.heard(report(now, None, heard=0.0), now)
    assert rate.budget(now) <= 1.1 * LEAST


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


class EmulatedLink:
    """A link of which the camera has a constant room, and reports what passes, 0.2 s after 0.2 s.

    The paces it measures are `noise` (log-normal) about the room. A link that packs what arrives
    hides its room: all parts arrive at one instant.
    """

    def __init__(self, room: float, noise: float, seed: int, *, hides: bool = False) -> None:
        self.room = room  # [kbit/s]
        self.bitrates: list[float] = []  # [kbit/s] of the encoder
        self.waits: list[float] = []  # [s] for what was sent before
        self._noise, self._random, self._hides = noise, np.random.default_rng(seed), hides
        self._law, self._now = law(), 0

    def run(self, seconds: float) -> None:
        queue = 0.0  # [kbit]
        for _ in range(round(seconds * S / PERIOD)):
            self._now += PERIOD
            before = self.bitrates[-1] if self.bitrates else 0.0
            kbit = encoder_kbit(self._law.budget(self._now), before)
            self._law.sent(self._now)
            # What has waited for a second is dropped.
            queue = min(max(0.0, queue + (kbit - self.room) * PERIOD / S), self.room)
            way = 30.0 + 1e3 * queue / self.room + 60.0 * self._noise * self._random.random()
            pace = self.room * float(np.exp(self._noise * self._random.standard_normal()))
            heard = report(
                self._now, 1e6 if self._hides else pace, way=way, heard=min(kbit, self.room)
            )
            self._law.heard(heard, self._now)
            self.bitrates.append(kbit)
            self.waits.append(queue / self.room)


@settings(max_examples=40)
@given(st.floats(30.0, 10_000.0), st.floats(0.0, 0.15), st.integers(0, 1000))
def test_on_a_link_that_does_not_change_it_settles(room: float, noise: float, seed: int) -> None:
    link = EmulatedLink(room, noise, seed)
    link.run(50.0)
    last = link.bitrates[-100:]  # 20 s
    assert 1.0 - min(last) / max(last) <= 0.2 + 1e-9
    assert min(0.4 * room, 0.8 * MOST) < min(last)
    assert max(last) < room
    assert max(link.waits[-100:]) == 0.0


@settings(max_examples=20)
@given(st.floats(40.0, 1500.0), st.floats(40.0, 1500.0), st.integers(0, 1000))
def test_a_change_of_the_room_is_followed_within_two_seconds(
    before: float, after: float, seed: int
) -> None:
    link = EmulatedLink(before, 0.05, seed)
    link.run(20.0)
    link.room = after
    link.run(2.0)
    if after < before:
        assert link.bitrates[-1] <= 1.15 * after
    elif after > 3.0 * before:
        assert link.bitrates[-1] > link.bitrates[-11]
    link.run(4.0)
    assert 0.4 * after < link.bitrates[-1] <= after


@pytest.mark.parametrize("room", [60.0, 200.0, 900.0])
def test_a_link_that_hides_its_room_is_rarely_overloaded(room: float) -> None:
    link = EmulatedLink(room, 0.05, 1, hides=True)
    link.run(300.0)
    assert np.mean(np.array(link.waits) > 0.1) < 0.1
    assert np.mean(link.bitrates[-100:]) > 0.3 * room


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
