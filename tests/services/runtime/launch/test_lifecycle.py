"""The laws of a child's life, whatever happens in whatever order; and who does not answer."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.runtime.launch.supervisor import (
    BACK_OFF_S,
    LATE_S,
    MISTAKE,
    PUNCTUAL_S,
    SILENT_S,
    STEADY_S,
    STUCK_S,
    Action,
    Ended,
    HangDetector,
    Life,
    LifeEvent,
    Phase,
    SilenceChange,
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
def test_there_are_never_two_processes_for_one_child_and_none_of_an_unwanted_or_failed_one(
    story: list[tuple[int, LifeEvent | Ended]],
):
    life, now, processes, done = Life(), 0, 0, False
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


# A process that runs without answering is named, once each time, and no other one is.


STEP_NS = 100_000_000  # [ns] between two looks
PATIENCE_S = 3.0
PHASES: tuple[Phase, ...] = ("waiting", "running", "stopping", "ended")
SILENCES = st.lists(
    st.tuples(
        st.booleans(), st.sampled_from(PHASES), st.booleans(), st.booleans(), st.integers(1, 60)
    ),
    max_size=10,
)  # does its loop go round, in which phase, was it started again, is it stuck, for how many looks


@settings(max_examples=300, deadline=None)
@given(SILENCES, st.sampled_from([SILENT_S, PATIENCE_S]))
def test_only_a_life_that_has_beaten_and_then_stopped_is_named(
    story: list[tuple[bool, Phase, bool, bool, int]], patience_s: float
) -> None:
    answering = HangDetector({"control": patience_s})
    now, life, beat, named, given_up = 0, Life(lives=1), None, False, False
    for beats, phase, again, is_stuck, looks in story:
        named, given_up = named and not again, given_up and not again
        life = Life(phase=phase, lives=life.lives + again, at=now if again else life.at)
        for _ in range(looks):
            now += STEP_NS
            beat = now if beats else beat
            changes = answering.look({"control": beat}, {"control": life}, now, lambda _: is_stuck)  # noqa: B023
            judged = phase == "running" and beat is not None and beat >= life.at
            silence_s = 0.0 if beat is None else (now - max(beat, STEP_NS)) / 1e9
            stuck = judged and is_stuck and silence_s > STUCK_S
            silent = stuck or (judged and silence_s > (STUCK_S if named else SILENT_S))
            hopeless = stuck or (judged and silence_s > max(SILENT_S, patience_s))
            expected = [
                *([SilenceChange("control", "silent")] if silent and not named else []),
                *([SilenceChange("control", "hopeless")] if hopeless and not given_up else []),
                *([SilenceChange("control", "again")] if judged and named and not silent else []),
            ]
            assert changes == expected
            assert ("control" in answering.silent) == silent
            named, given_up = silent, silent and (hopeless or given_up)


def test_a_computer_that_was_asleep_is_nobodys_fault() -> None:
    answering, life = HangDetector(), {"control": Life(phase="running", lives=1)}
    assert answering.look({"control": 0}, life, 0) == []
    asleep = round((LATE_S + 100.0) * 1e9)
    assert answering.look({"control": 0}, life, asleep) == []
    soon = asleep + round(0.9 * SILENT_S * 1e9)
    for now in range(asleep, soon, STEP_NS):
        assert answering.look({"control": 0}, life, now) == []
    late = [
        change
        for now in range(soon, soon + 2 * STEP_NS, STEP_NS // 2)
        for change in answering.look({"control": 0}, life, now)
    ]
    assert [change.what for change in late] == ["silent", "hopeless"]


def test_who_is_stuck_is_not_waited_for_but_by_a_supervisor_that_is_late_itself() -> None:
    """After a pause of the whole computer a process had no time to beat."""
    for gap_s, what in [(PUNCTUAL_S, ["silent", "hopeless"]), (1.1 * PUNCTUAL_S, list[str]())]:
        answering, life = HangDetector(), {"tether": Life(phase="running", lives=1)}
        before = round(0.9 * STUCK_S * 1e9)
        assert answering.look({"tether": 0}, life, before - STEP_NS, lambda _: True) == []
        assert answering.look({"tether": 0}, life, before, lambda _: True) == []
        late = before + round(gap_s * 1e9)
        changes = answering.look({"tether": 0}, life, late, lambda _: True)
        assert [change.what for change in changes] == what
