"""The laws of a child's life, whatever happens in whatever order."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.runtime.launch.supervisor import (
    BACK_OFF_S,
    MISTAKE,
    STEADY_S,
    Action,
    Ended,
    Life,
    LifeEvent,
    advance,
)

PAUSES = st.integers(0, 20_000_000_000)  # [ns] between two events
EVENTS = st.one_of(
    st.sampled_from(LifeEvent), st.builds(Ended, st.sampled_from([0, MISTAKE, 2, -9, -15]))
)
STORIES = st.lists(st.tuples(PAUSES, EVENTS), max_size=60)


def seconds(value: float) -> int:
    return round(value * 1e9)


def after(life: Life, *events: LifeEvent | Ended, now: int = 0) -> Life:
    for event in events:
        life, _ = advance(life, event, now)
    return life


@settings(max_examples=200, deadline=None)
@given(STORIES)
def test_there_are_never_two_processes_for_one_child(story: list[tuple[int, LifeEvent | Ended]]):
    life, now, processes = Life(), 0, 0
    for pause, event in story:
        now += pause
        if isinstance(event, Ended):
            if processes == 0:
                continue  # what does not run cannot end
            processes -= 1
        life, action = advance(life, event, now)
        processes += action is Action.START
        assert processes == (life.phase in ("running", "stopping"))
        assert processes <= 1


@settings(max_examples=200, deadline=None)
@given(STORIES)
def test_an_unwanted_or_failed_child_is_never_started_again(
    story: list[tuple[int, LifeEvent | Ended]],
):
    life, now, done = Life(), 0, False
    for pause, event in story:
        now += pause
        life, action = advance(life, event, now)
        assert not (done and action is Action.START)
        done = done or event is LifeEvent.STOP or life.phase == "failed"


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(0, seconds(30)), min_size=1, max_size=12))
def test_every_crash_is_followed_by_one_restart_within_the_longest_back_off(lengths: list[int]):
    life, now = after(Life(), LifeEvent.TICK, LifeEvent.SEEN), 0
    for crashes, length in enumerate(lengths, 1):
        now += length
        life = after(life, Ended(-9), now=now)
        pause = life.at - now
        assert seconds(BACK_OFF_S[0]) <= pause <= seconds(BACK_OFF_S[-1])
        assert after(life, LifeEvent.TICK, now=life.at - 1).phase == "waiting"
        now = life.at
        life, action = advance(life, LifeEvent.TICK, now)
        assert action is Action.START
        assert life.restarts == crashes


def test_the_back_off_grows_with_each_crash_in_a_row_and_then_stays():
    life, pauses = after(Life(), LifeEvent.TICK, LifeEvent.SEEN), list[float]()
    for _ in range(7):
        crashed_at = life.at
        life = after(life, Ended(-11), now=crashed_at)
        pauses.append((life.at - crashed_at) / 1e9)
        life = after(life, LifeEvent.TICK, now=life.at)
    assert pauses == [*BACK_OFF_S, BACK_OFF_S[-1], BACK_OFF_S[-1]]


def test_a_steady_life_makes_the_next_restart_quick_again():
    life = after(Life(crashes=4), LifeEvent.TICK, LifeEvent.SEEN)
    at = seconds(STEADY_S)
    assert after(life, Ended(-9), now=at).at == at + seconds(BACK_OFF_S[0])
    assert after(life, Ended(-9), now=at - 1).at == at - 1 + seconds(BACK_OFF_S[-1])


def test_status_1_before_it_was_ever_alive_is_the_users_mistake():
    _, action = advance(after(Life(), LifeEvent.TICK), Ended(MISTAKE), 1)
    assert action is Action.GIVE_UP


@pytest.mark.parametrize(("seen", "status"), [(False, 0), (True, 0), (True, MISTAKE)])
def test_an_end_that_nobody_asked_for_is_a_crash(seen: bool, status: int):
    life = after(Life(seen=seen), LifeEvent.TICK)
    life, action = advance(life, Ended(status), 1)
    assert (life.phase, life.crashes, action) == ("waiting", 1, None)


def test_a_child_that_waits_for_its_restart_ends_at_once_when_it_is_no_longer_wanted():
    life = after(Life(), LifeEvent.TICK, LifeEvent.SEEN, Ended(-9), LifeEvent.STOP)
    assert after(life, LifeEvent.TICK, now=seconds(60)).phase == "ended"
