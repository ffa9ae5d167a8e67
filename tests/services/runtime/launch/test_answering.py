"""A process that runs without answering is named, once each time, and no other one is."""

from hypothesis import given, settings
from hypothesis import strategies as st

from services.runtime.launch.answering import PATIENCE_S, Answering
from services.runtime.launch.lifecycle import Life, Phase

STEP_NS = 40_000_000  # [ns] between two looks
PATIENCE = round(PATIENCE_S * 1e9 / STEP_NS)  # looks
PHASES: tuple[Phase, ...] = ("waiting", "running", "stopping", "ended")
STORIES = st.lists(
    st.tuples(st.booleans(), st.sampled_from(PHASES), st.integers(0, 1), st.integers(1, 60)),
    max_size=12,
)  # is it heard, in which phase, started again, for how many looks


@settings(max_examples=300, deadline=None)
@given(STORIES)
def test_only_a_life_that_was_heard_and_then_silent_for_long_enough_is_named(
    story: list[tuple[bool, Phase, int, int]],
):
    answering, now, lives = Answering(), 0, 1
    heard_in, quiet, hangs = 0, 0, False  # the last life heard, silent looks, what we expect
    for heard, phase, again, looks in story:
        lives += again
        for _ in range(looks):
            now += STEP_NS
            life = Life(phase=phase, lives=lives)
            changes = answering.look(() if heard else ("control",), {"control": life}, now)
            if heard:
                heard_in, quiet = lives, 0
            elif phase == "running" and heard_in == lives:
                quiet += 1
            else:
                quiet = 0
            before, hangs = hangs, quiet > PATIENCE
            named, recovered = hangs and not before, before and heard
            assert changes == ([("control", recovered)] if named or recovered else [])
            assert ("control" in answering.silent) == hangs


def test_each_time_is_counted():
    answering, life, now = Answering(), {"control": Life(phase="running", lives=1)}, 0
    for times in range(1, 4):
        for unheard in ((), ("control",)):
            for _ in range(PATIENCE + 2):
                now += STEP_NS
                answering.look(unheard, life, now)
        assert answering.times == {"control": times}
