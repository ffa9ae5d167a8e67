"""Recorded time follows real time at the speed that was asked for, and stands in a pause."""

from hypothesis import given
from hypothesis import strategies as st

from tools.replay.play_clock import PlayClock
from tools.replay.terminal import KEYS, keys_in

SECOND = 1_000_000_000
BEGIN, END = 1_700_000_000 * SECOND, 1_700_000_100 * SECOND
SPEED = st.sampled_from([0.01, 0.3, 1.0, 2.0, 10.0, 1000.0])
MOMENT = st.integers(0, 200 * SECOND)


@given(SPEED, MOMENT)
def test_a_message_is_due_when_its_time_is_reached(speed: float, gone: int) -> None:
    clock = PlayClock(BEGIN, END, speed, 5 * SECOND)
    now = 5 * SECOND + gone
    position = clock.position(now)
    assert BEGIN <= position <= END
    assert clock.due(position) <= now + 1 + 1 / speed  # rounded to whole nanoseconds
    if position < END:
        assert abs(clock.due(position) - now) <= 1 + 1 / speed


@given(SPEED, st.lists(st.tuples(st.sampled_from(["wait", "pause", "jump"]), MOMENT), max_size=8))
def test_whatever_is_pressed_it_stays_within_the_recording(
    speed: float, steps: list[tuple[str, int]]
) -> None:
    now, clock = 0, PlayClock(BEGIN, END, speed, 0)
    for what, number in steps:
        if what == "wait":
            before, now = clock.position(now), now + number
            assert clock.position(now) >= before
            assert clock.playing or clock.position(now) == before
        elif what == "pause":
            before = clock.position(now)
            clock.toggle(now)
            assert clock.position(now) == before
        else:
            clock.jump(BEGIN + number - 50 * SECOND, now)
        assert BEGIN <= clock.position(now) <= END


def test_it_is_over_at_the_end_and_not_again_after_a_jump_back() -> None:
    clock = PlayClock(BEGIN, END, 10.0, 0)
    assert not clock.over(9 * SECOND)
    assert clock.over(10 * SECOND)
    clock.jump(BEGIN, 10 * SECOND)
    assert not clock.over(19 * SECOND)


@given(st.binary(max_size=30))
def test_any_keys_are_understood_or_passed_over(typed: bytes) -> None:
    assert set(keys_in(typed)) <= set(KEYS.values())


def test_arrows_space_and_q() -> None:
    assert keys_in(b" \x1b[C\x1b[Dxq\x1bOA") == ["pause", "on", "back", "quit", "on_far"]
