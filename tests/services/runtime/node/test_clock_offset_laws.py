"""Stamps of the other machine's clock: both sides agree, and what is not known is not guessed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.link import Clock
from messages.topic import AnyTopic, Direction, Side
from services.runtime.node.clock_offset import ABOUT_CLOCKS, ClockOffset
from tests.support.messages import example

AHEAD = st.integers(-(10**15), 10**15)  # [ns] drone's clock minus the topside's
STAMPS = st.integers(0, 10**15)
ROWS = st.sampled_from(topics.ALL)


def clock(offset: int | None, bound: int | None = 0) -> Clock:
    return example(Clock, offset_ns=offset, bound_ns=bound)


def told(side: Side, ahead: int, bound: int = 0, now: int = 0) -> ClockOffset:
    offset = ClockOffset(side)
    offset.learn(clock(ahead, bound), now)
    return offset


@given(AHEAD, STAMPS)
def test_both_sides_read_the_same_instant(ahead: int, instant: int) -> None:
    """`instant` [ns] by the topside's clock; the drone's shows `ahead` more."""
    topside, drone = told("topside", ahead), told("drone", ahead)
    assert drone.local_ns(topics.PILOT_COMMAND, instant) == instant + ahead
    assert topside.local_ns(topics.STATE, instant + ahead) == instant
    assert topside.ahead_ns == -(drone.ahead_ns or 0)


@given(ROWS, AHEAD, STAMPS)
def test_own_stamps_stay_as_they_are_and_those_of_either_clock_are_not_read(
    topic: AnyTopic, ahead: int, stamp: int
) -> None:
    own_ways: dict[Side, set[Direction]] = {
        "topside": {Direction.DOWN},
        "drone": {Direction.UP, Direction.STAY},
    }
    for side, own in own_ways.items():
        offset = told(side, ahead)
        if topic.way is Direction.BOTH:
            assert offset.local_ns(topic, stamp) is None
            assert not offset.judges(topic)
        elif topic.way in own:
            assert offset.local_ns(topic, stamp) == stamp
            assert not offset.concerns(topic)


@given(ROWS)
def test_what_crosses_concerns_one_side_only_and_clocks_carry_their_own_time(
    topic: AnyTopic,
) -> None:
    concerned = [side for side in ("topside", "drone") if ClockOffset(side).concerns(topic)]
    expected = {Direction.UP: ["topside"], Direction.DOWN: ["drone"]}.get(topic.way, [])
    assert concerned == ([] if topic.message in ABOUT_CLOCKS else expected)


@given(st.integers(0, 10**9), STAMPS, st.integers(0, 10**13), st.integers(0, 10**13))
def test_knowledge_ages_by_the_drift_of_two_crystals_and_never_gets_better_by_itself(
    bound: int, learnt: int, earlier: int, later: int
) -> None:
    offset = told("drone", 0, bound, learnt)
    first, second = sorted((learnt + earlier, learnt + later))
    assert bound <= offset.bound_ns(first) <= offset.bound_ns(second)
    assert offset.bound_ns(second) == bound + round(1e-4 * (second - learnt))
    assert offset.bound_ns(learnt - 1) == bound  # a clock that is looked at before it was learnt


@pytest.mark.parametrize("lost", [clock(None, 5), clock(5, None), clock(None, None)])
def test_a_clock_that_is_not_known_any_more_is_not_used(lost: Clock) -> None:
    offset = told("drone", 1000)
    offset.learn(lost, 1)
    assert offset.ahead_ns is None
    assert offset.local_ns(topics.PILOT_COMMAND, 7) is None
