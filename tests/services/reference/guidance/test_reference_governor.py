"""The guard that makes a reference wait for a vehicle that is held back."""

from math import exp

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.reference.guidance.guards import RETURN_S, ReferenceGovernor, is_released
from services.reference.trajectory.minimum_jerk import Sample

size = st.floats(0.0, 1e6)
most = st.floats(1e-3, 1e3)


@given(most, st.lists(st.tuples(size, st.floats(0.0, 1.0), st.booleans())))
def test_never_more_than_the_most_remains_and_never_more_than_there_was(
    most: float, steps: list[tuple[float, float, bool]]
) -> None:
    guard = ReferenceGovernor(most)
    for error, dt, released in steps:
        share = guard.keep(error, dt, released=released)
        assert 0.0 <= share <= 1.0
        assert share * error <= most * (1 + 1e-12)


@given(most, st.lists(st.floats(0.0, 1.0)))
def test_an_error_within_the_limit_is_left_alone(most: float, shares: list[float]) -> None:
    guard = ReferenceGovernor(most)
    assert all(guard.keep(most * x, 0.01, released=True) == 1.0 for x in shares)


@given(most)
def test_blocked_and_released_it_comes_to_the_vehicle_and_is_done(most: float) -> None:
    guard, error, seconds = ReferenceGovernor(most), 2 * most, 0.0
    error *= guard.keep(error, 0.01, released=False)
    while guard.blocked and seconds < 10 * RETURN_S:
        error *= guard.keep(error, 0.01, released=True)
        seconds += 0.01
    assert not guard.blocked
    assert error <= most / 10
    assert guard.keep(error, 0.01, released=True) == 1.0


@given(most, st.floats(0.0, 0.99) | st.floats(0.09, 0.11), st.booleans())
def test_it_holds_back_until_half_the_limit_and_once_released_until_a_tenth(
    most: float, share: float, released: bool
) -> None:
    guard = ReferenceGovernor(most)
    guard.keep(2 * most, 0.01, released=False)
    assert guard.blocked
    guard.keep(share * most, 0.01, released=released)
    end = 0.1 if released else 0.5
    assert guard.blocked == (share >= end) or abs(share - end) < 1e-9


@given(most, st.floats(0.2, 1.0), st.floats(0.0, 2.0))
def test_once_released_the_error_falls_to_a_third_every_half_second(
    most: float, begin: float, seconds: float
) -> None:
    """e⁻¹, with a tick of a thousandth of a second, until a tenth of the limit is left."""
    guard, error = ReferenceGovernor(most, blocked=True), begin * most
    for _ in range(round(1000 * seconds)):
        error *= guard.keep(error, 0.001, released=True)
    expected = max(begin * exp(-seconds / 0.5), 0.1)
    assert error == pytest.approx(expected * most, rel=0.01)


@given(most, st.floats(0.11, 1.0), st.floats(0.0, 5.0), st.floats(0.0, 5.0))
def test_a_longer_tick_leaves_less_and_the_longest_nothing(
    most: float, share: float, one: float, other: float
) -> None:
    short, long = (
        ReferenceGovernor(most, blocked=True).keep(share * most, dt, released=True)
        for dt in sorted((one, other))
    )
    assert 1.0 >= short >= long >= 0.0
    assert (long == 0.0) == (max(one, other) >= 0.5)


speed = st.floats(0.01, 2.0)


@given(speed, speed, st.booleans())
def test_a_stick_counts_as_released_when_the_reference_slows_down_or_rests(
    velocity: float, acceleration: float, down: bool
) -> None:
    v, a = (velocity, acceleration) if down else (-velocity, -acceleration)
    assert is_released(Sample(1.0, v, -a, 0.0))
    assert is_released(Sample(1.0, 0.0, 0.0, 0.0))
    assert not is_released(Sample(1.0, v, a, 0.0))
    assert not is_released(Sample(1.0, v, 0.0, 0.0))  # the stick is kept
    assert not is_released(Sample(1.0, 0.0, a, 0.0))  # it begins


@given(speed, speed, speed)
def test_a_place_is_released_by_all_of_its_motion(north: float, east: float, slower: float) -> None:
    """Slowing down north while speeding up east is a turn unless the speed falls."""
    motions = Sample(0.0, north, -slower, 0.0), Sample(0.0, east, slower, 0.0)
    assert is_released(*motions) == (east * slower < north * slower)
    assert not is_released(Sample(0.0, 0.0, 0.0, 0.0), Sample(0.0, east, 0.0, 0.0))
