"""The guard that makes a reference wait for a vehicle that is held back."""

from hypothesis import given
from hypothesis import strategies as st

from services.reference.guidance.reference_governor import GIVE_IN_S, ReferenceGovernor, is_let_go
from services.reference.trajectory.minimum_jerk import Sample

size = st.floats(0.0, 1e6)
most = st.floats(1e-3, 1e3)


@given(most, st.lists(st.tuples(size, st.floats(0.0, 1.0), st.booleans())))
def test_never_more_than_the_most_remains_and_never_more_than_there_was(
    most: float, steps: list[tuple[float, float, bool]]
) -> None:
    guard = ReferenceGovernor(most)
    for error, dt, let_go in steps:
        share = guard.keep(error, dt, let_go=let_go)
        assert 0.0 <= share <= 1.0
        assert share * error <= most * (1 + 1e-12)


@given(most, st.lists(st.floats(0.0, 1.0)))
def test_an_error_within_the_limit_is_left_alone(most: float, shares: list[float]) -> None:
    guard = ReferenceGovernor(most)
    assert all(guard.keep(most * x, 0.01, let_go=True) == 1.0 for x in shares)


@given(most)
def test_held_back_and_let_go_it_comes_to_the_vehicle_and_is_done(most: float) -> None:
    guard, error, seconds = ReferenceGovernor(most), 2 * most, 0.0
    error *= guard.keep(error, 0.01, let_go=False)
    while guard.held_back and seconds < 10 * GIVE_IN_S:
        error *= guard.keep(error, 0.01, let_go=True)
        seconds += 0.01
    assert not guard.held_back
    assert error <= most / 10
    assert guard.keep(error, 0.01, let_go=True) == 1.0


@given(most, st.floats(0.0, 0.99) | st.floats(0.09, 0.11), st.booleans())
def test_it_holds_back_until_half_the_limit_and_once_let_go_until_a_tenth(
    most: float, share: float, let_go: bool
) -> None:
    guard = ReferenceGovernor(most)
    guard.keep(2 * most, 0.01, let_go=False)
    assert guard.held_back
    guard.keep(share * most, 0.01, let_go=let_go)
    end = 0.1 if let_go else 0.5
    assert guard.held_back == (share >= end) or abs(share - end) < 1e-9


speed = st.floats(0.01, 2.0)


@given(speed, speed, st.booleans())
def test_a_stick_is_let_go_when_the_reference_slows_down_or_rests(
    velocity: float, acceleration: float, down: bool
) -> None:
    v, a = (velocity, acceleration) if down else (-velocity, -acceleration)
    assert is_let_go(Sample(1.0, v, -a, 0.0))
    assert is_let_go(Sample(1.0, 0.0, 0.0, 0.0))
    assert not is_let_go(Sample(1.0, v, a, 0.0))
    assert not is_let_go(Sample(1.0, v, 0.0, 0.0))  # the stick is kept
    assert not is_let_go(Sample(1.0, 0.0, a, 0.0))  # it begins


@given(speed, speed, speed)
def test_a_place_is_let_go_by_all_of_its_motion(north: float, east: float, slower: float) -> None:
    """Slowing down north while speeding up east is a turn unless the speed falls."""
    motions = Sample(0.0, north, -slower, 0.0), Sample(0.0, east, slower, 0.0)
    assert is_let_go(*motions) == (east * slower < north * slower)
    assert not is_let_go(Sample(0.0, 0.0, 0.0, 0.0), Sample(0.0, east, 0.0, 0.0))
