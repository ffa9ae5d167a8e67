"""A process that runs without answering is named, once each time, and no other one is."""

from hypothesis import given, settings
from hypothesis import strategies as st

from services.runtime.launch.answering import STILL_S, UNHEARD_S, Answering
from services.runtime.launch.lifecycle import Life, Phase

STEP_NS = 200_000_000  # [ns] between two looks
STILL, UNHEARD = (round(s * 1e9 / STEP_NS) for s in (STILL_S, UNHEARD_S))  # looks
PHASES: tuple[Phase, ...] = ("waiting", "running", "stopping", "ended")
STORIES = st.lists(
    st.tuples(
        st.booleans(), st.sampled_from(PHASES), st.integers(0, 1), st.booleans(), st.integers(1, 90)
    ),
    max_size=12,
)  # is it heard, in which phase, started again, does it work, for how many looks


@settings(max_examples=300, deadline=None)
@given(STORIES, st.booleans())
def test_only_a_life_that_was_heard_and_then_silent_for_long_enough_is_named(
    story: list[tuple[bool, Phase, int, bool, int]], tells: bool
):
    answering, now, lives, ran = Answering(), 0, 1, 0
    heard_in, quiet, still, hangs = 0, 0, 0, False  # the last life heard, looks, what we expect
    for heard, phase, again, works, looks in story:
        lives += again
        for _ in range(looks):
            now += STEP_NS
            ran += works
            life = Life(phase=phase, lives=lives)
            unheard = {} if heard else {"control": ran if tells else None}
            changes = answering.look(unheard, {"control": life}, now)
            if heard:
                heard_in = lives
            counts = not heard and phase == "running" and heard_in == lives
            quiet = quiet + 1 if counts else 0
            still = (1 if works or quiet == 1 else still + 1) if counts else 0
            before = hangs
            hangs = counts and (before or quiet > UNHEARD or (tells and still > STILL))
            named, recovered = hangs and not before, before and heard
            assert changes == ([("control", recovered)] if named or recovered else [])
            assert ("control" in answering.silent) == hangs


def test_each_time_is_counted():
    answering, life, now = Answering(), {"control": Life(phase="running", lives=1)}, 0
    for times in range(1, 4):
        for unheard in ({}, {"control": 7}):
            for _ in range(STILL + 2):
                now += STEP_NS
                answering.look(unheard, life, now)
        assert answering.times == {"control": times}
