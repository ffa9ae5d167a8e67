"""Values of the board: of when they are by its clock, and which are new."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.ardusub.telemetry import (
    FIELD_SAME_NS,
    PERIOD_NS,
    BatteryMeter,
    BoardClock,
    BoardUpdates,
)

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


# Of the many messages that repeat a value, which bring one, and of when it is.


AGE_NS, SAME_NS = 40 * MS, 250 * MS


@given(st.integers(5, 100), st.integers(0, 99), st.integers(0, 10**15))
def test_every_value_is_used_once_and_stamped_within_half_a_message_of_its_time(
    every_ms: int, phase_ms: int, boot: int
) -> None:
    """Values are taken over every 100 ms and sent every few, at any phase."""
    updates = BoardUpdates(AGE_NS, SAME_NS)
    found = dict[float, int]()
    for sent in range(boot, boot + 3000 * MS, every_ms * MS):
        number = (sent - boot + phase_ms * MS) // PERIOD_NS
        measured = updates.measured_at(float(number), sent)
        if measured is not None:
            assert number not in found
            found[number] = measured
    values = sorted(found)
    assert values == list(range(int(values[0]), int(values[-1]) + 1))
    for number in values[1:]:
        taken_over = boot + int(number) * PERIOD_NS - phase_ms * MS
        assert abs(found[number] - (taken_over - AGE_NS)) <= every_ms * MS / 2
    assert sorted(found.values()) == [found[number] for number in values]


def test_a_sensor_that_is_frozen_is_still_seen() -> None:
    updates = BoardUpdates(AGE_NS, SAME_NS)
    stamps = [at for ms in range(0, 3000, 25) if (at := updates.measured_at(1013.0, ms * MS))]
    steps = {after - before for before, after in pairwise(stamps)}
    assert steps == {SAME_NS}


def test_a_value_after_a_gap_is_not_taken_for_older_than_the_boards_period() -> None:
    updates = BoardUpdates(AGE_NS, SAME_NS)
    updates.measured_at(1013.0, 0)
    assert updates.measured_at(1014.0, 5000 * MS) == 5000 * MS - AGE_NS - PERIOD_NS // 2


@given(st.lists(st.booleans(), min_size=30, max_size=30), st.integers(5, 25))
def test_a_value_that_is_measured_again_is_not_missing(again: list[bool], every_ms: int) -> None:
    """However often a new value is equal to the one before: never a gap of more than the patience
    and a message, and one more between the two ways of stamping."""
    updates = BoardUpdates(AGE_NS, FIELD_SAME_NS)
    value, values = 0, list[int]()
    for same in again:
        value += not same
        values.append(value)
    stamps = [
        at
        for sent in range(0, len(values) * PERIOD_NS, every_ms * MS)
        if (at := updates.measured_at(values[sent // PERIOD_NS], sent)) is not None
    ]
    steps = [after - before for before, after in pairwise(stamps)]
    assert all(0 < step <= FIELD_SAME_NS + 2 * every_ms * MS for step in steps)


def test_a_current_that_is_not_measured_is_unknown_and_no_zero() -> None:
    meter, found = BatteryMeter(), list[tuple[float | None, float | None]]()
    for second, raw in enumerate((-1, 200, 0, 200, -1)):  # [cA]
        fields = {"voltage_battery": 18_000, "current_battery": raw}
        sample = meter.sample(fields, second * 1000 * MS)
        assert sample is not None
        found.append((sample.current, None if sample.used_wh is None else sample.used_wh * 3600))
    assert found == [(None, None), (2.0, 36.0), (0.0, 36.0), (2.0, 72.0), (None, 72.0)]
