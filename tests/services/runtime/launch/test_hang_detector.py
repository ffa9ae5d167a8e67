"""A process that runs without answering is named, once each time, and no other one is."""

from hypothesis import given, settings
from hypothesis import strategies as st

from services.runtime.launch.supervisor import (
    LATE_S,
    PUNCTUAL_S,
    SILENT_S,
    STUCK_S,
    HangDetector,
    Life,
    Phase,
    SilenceChange,
)

STEP_NS = 100_000_000  # [ns] between two looks
PATIENCE_S = 3.0
PHASES: tuple[Phase, ...] = ("waiting", "running", "stopping", "ended")
STORIES = st.lists(
    st.tuples(
        st.booleans(), st.sampled_from(PHASES), st.booleans(), st.booleans(), st.integers(1, 60)
    ),
    max_size=10,
)  # does its loop go round, in which phase, was it started again, is it stuck, for how many looks


@settings(max_examples=300, deadline=None)
@given(STORIES, st.sampled_from([SILENT_S, PATIENCE_S]))
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
