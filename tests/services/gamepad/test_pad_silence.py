"""A pad that stays connected and stops answering: what is known of it, and what is not."""

from hypothesis import assume, given
from hypothesis import strategies as st

from services.gamepad.core import STOP, PadSilence, held_by_a_hand

MS, S = 1_000_000, 1_000_000_000  # [ns]
STEP = 20 * MS  # a reading
DEAD_BAND, AFTER = 0.12, 5.0
NAMES = ("leftx", "lefty", "rightx", "righty")

travel = st.floats(-1.0, 1.0)
sticks = st.fixed_dictionaries(dict.fromkeys(NAMES, travel))
centred = st.fixed_dictionaries(dict.fromkeys(NAMES, st.floats(-DEAD_BAND, DEAD_BAND)))


def silence() -> PadSilence:
    return PadSilence(AFTER, DEAD_BAND)


def still(pad: PadSilence, controls: dict[str, float], start: int, end: int) -> int | None:
    """The first instant at which the pad counts as lost, if none of its controls changes."""
    for now in range(start, end, STEP):
        if pad.read(controls, now).lost:
            return now
    return None


@given(centred)
def test_a_pad_with_centred_sticks_is_never_lost(controls: dict[str, float]):
    pad = silence()
    assert still(pad, controls, 0, 20 * S) is None
    assert pad.read(controls, 3600 * S) == (0, False)


@given(sticks, st.integers(0, 20))
def test_a_pad_that_is_frozen_with_a_stick_in_a_hand_is_lost_within_silent_after(
    controls: dict[str, float], moves: int
):
    assume(held_by_a_hand(controls, DEAD_BAND))
    pad = silence()
    for n in range(moves):
        pad.read({**controls, "lefty": n / 100}, n * STEP)
    froze = moves * STEP
    lost = still(pad, controls, froze, froze + 10 * S)
    assert lost is not None
    assert AFTER * S - STEP <= lost - froze <= AFTER * S + STEP
    later = pad.read(controls, lost + 7 * S)
    assert later.lost
    assert later.age_ns >= 7 * S + AFTER * S - STEP  # it grows


@given(sticks, st.lists(st.integers(1, int(AFTER * 50) - 1), min_size=1, max_size=8))
def test_a_pad_that_jitters_by_one_count_is_never_lost(controls: dict[str, float], gaps: list[int]):
    pad, now = silence(), 0
    for n, gap in enumerate(gaps):
        moved = {**controls, "leftx": controls["leftx"] + (n % 2) / 32767}
        for _ in range(gap):
            assert not pad.read(moved, now).lost
            now += STEP


@given(st.floats(STOP, 1.0), st.sampled_from(NAMES), st.sampled_from([-1, 1]))
def test_a_stick_against_its_stop_may_be_held_for_ever(deflection: float, name: str, sign: int):
    assert still(silence(), {name: sign * deflection}, 0, 20 * S) is None


def test_a_pad_that_answers_again_is_no_longer_lost():
    pad, held = silence(), {"lefty": 0.5}
    assert still(pad, held, 0, 10 * S) is not None
    assert pad.read({"lefty": 0.51}, 10 * S) == (0, False)
    assert still(pad, {"lefty": 0.51}, 10 * S, 14 * S) is None
