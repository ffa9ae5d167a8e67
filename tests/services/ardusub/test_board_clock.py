"""The board's clock against ours, whatever the delays."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.ardusub.telemetry import BoardClock

MS, S = 1_000_000, 1_000_000_000  # [ns]
delays = st.lists(
    st.tuples(st.integers(0, 30 * MS), st.integers(0, 30 * MS)), min_size=1, max_size=40
)


@given(delays, st.integers(-1000 * S, 1000 * S), st.floats(-50e-6, 50e-6))
def test_the_offset_is_within_its_bound(
    trips: list[tuple[int, int]], offset: int, drift: float
) -> None:
    """Whatever the delays of the two ways, and with crystals that differ by up to 50 ppm."""
    clock, now = BoardClock(), 2000 * S
    for down, up in trips:
        board = round((now + down) * (1 + drift)) - offset
        assert clock.answered(now, board, now + down + up)
        now += down + up + 200 * MS
        stamped = round(now * (1 + drift)) - offset
        assert clock.heard(stamped, now + 3 * MS)
        ours = clock.ours(stamped, now + 3 * MS)
        assert ours is not None
        assert abs(ours - now) <= clock.bound_ns + 1
        assert ours <= now + 3 * MS
    assert clock.jumps == 0


def test_nothing_is_known_before_an_answer() -> None:
    clock = BoardClock()
    assert clock.heard(5 * S, 9 * S)
    assert clock.ours(5 * S, 9 * S) is None


@given(
    st.lists(st.integers(-40 * MS, 40 * MS), max_size=30).map(lambda some: (200 * MS, some))
    | st.lists(st.integers(-900 * MS, 900 * MS), max_size=30).map(lambda some: (S, some))
)
def test_a_clock_that_shifts_is_followed(shifted: tuple[int, list[int]]) -> None:
    """By milliseconds, and as of ArduSub's simulator on a busy computer, which stands still and
    catches up: a dive must not end by it."""
    clock, now, offset = BoardClock(), 100 * S, 50 * S
    every, shifts = shifted
    for shift in [0, *shifts]:
        offset += shift
        assert clock.answered(now, now + MS - offset, now + 2 * MS)
        ours = clock.ours(now + MS - offset, now + 2 * MS)
        assert ours is not None
        assert abs(ours - now - MS) <= 1.1 * MS
        now += every
    assert clock.jumps == 0
    assert clock.shifts >= sum(abs(shift) > 4 * MS for shift in shifts)


@pytest.mark.parametrize("jump", [-10 * S, -S, 1200 * MS, 10 * S])
def test_a_jump_is_noticed_with_the_next_answer(jump: int) -> None:
    clock, now = BoardClock(), 100 * S
    for _ in range(10):
        assert clock.answered(now, now + MS - 50 * S, now + 2 * MS)
        now += 200 * MS
    assert not clock.answered(now, now + MS - 50 * S + jump, now + 2 * MS)
    assert clock.jumps == 1
    assert clock.ours(now + MS - 50 * S + jump, now + 2 * MS) == pytest.approx(now + MS, abs=2 * MS)
