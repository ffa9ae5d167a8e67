"""What a router leaves out of a stream is told from what a link loses, by how even it is."""

from collections import Counter
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from tools.log.account import LinkReports, account_for
from tools.log.numbering import Numbering
from tools.log.thinning import thinned

STEP_NS, APART_NS = 10_000_000, round(1e9 / topics.THIN_HZ)
HZ = topics.STATE.hz
seeds = st.integers(0, 10**6)


def heard(numbers: list[int]) -> Numbering:
    found = Numbering()
    for number in numbers:
        found.see(number, STEP_NS * number, STEP_NS * number)
    return found


def through_a_router(count: int, random: Random, late_ns: float) -> list[int]:
    """Numbers of the messages that a thinning router passes on. Each is late by chance; none
    overtakes another."""
    passed, at, last = list[int](), 0.0, -1e12
    for number in range(count):
        at = max(at, STEP_NS * number + random.expovariate(1.0 / late_ns))
        if at - last >= APART_NS:
            last = at
            passed.append(number)
    return passed


@given(seeds, st.floats(1e4, 3e6))
@settings(max_examples=30)
def test_what_a_router_leaves_out_is_thinned(seed: int, late_ns: float) -> None:
    numbering = heard(through_a_router(2000, Random(seed), late_ns))
    assert numbering.missing > 1200
    assert thinned(numbering.gaps, HZ) == numbering.missing


@given(seeds, st.floats(0.0, 0.99))
@settings(max_examples=40)
def test_what_is_lost_by_chance_is_lost(seed: int, share: float) -> None:
    random = Random(seed)
    numbering = heard([n for n in range(2000) if random.random() >= share])
    assert thinned(numbering.gaps, HZ) == 0


@given(seeds, st.integers(0, 8))
@settings(max_examples=20)
def test_of_what_a_thinned_stream_loses_most_is_lost(seed: int, lost: int) -> None:
    random = Random(seed)
    passed = through_a_router(2000, random, 1e5)
    holes = sorted(random.sample(range(100, len(passed) - 100), lost))
    numbering = heard([n for k, n in enumerate(passed) if k not in holes])
    counted = thinned(numbering.gaps, HZ)
    assert numbering.missing - 5 * lost <= counted <= numbering.missing - lost


@pytest.mark.parametrize("every", [1, 2, 10])
def test_an_even_stream_of_another_rate_is_not_one_that_is_thinned(every: int) -> None:
    assert thinned(heard(list(range(0, 4000, every))).gaps, HZ) == 0


def test_a_slow_stream_and_a_short_one_are_never_thinned() -> None:
    passed = through_a_router(2000, Random(1), 1e5)
    assert thinned(heard(passed).gaps, topics.STATUS.hz) == 0
    assert thinned(heard(passed[:100]).gaps, HZ) == 0


def test_a_recording_behind_a_thin_link_is_accounted_for() -> None:
    """Of one that services share no word about: nobody counted anything."""
    numberings = {
        topic.key: heard(through_a_router(2000, Random(1), 1e5))
        for topic in (topics.STATE, topics.PILOT_COMMAND)
    }
    found = account_for(numberings, LinkReports(), Counter(), "topside")
    state, command = found[topics.STATE.key], found[topics.PILOT_COMMAND.key]
    assert (state.missing, state.link) == (0, 0)
    assert state.thinned == state.sent - state.recorded > 1200
    assert command.thinned == 0
    assert command.missing > 1200  # no router thins what a pilot says
