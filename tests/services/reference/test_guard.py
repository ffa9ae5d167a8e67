"""The guard that makes a reference wait for a vehicle that is held back."""

from hypothesis import given
from hypothesis import strategies as st

from services.reference.guard import GIVE_IN_S, Guard

size = st.floats(0.0, 1e6)
most = st.floats(1e-3, 1e3)


@given(most, st.lists(st.tuples(size, st.floats(0.0, 1.0), st.booleans())))
def test_never_more_than_the_most_remains_and_never_more_than_there_was(
    most: float, steps: list[tuple[float, float, bool]]
) -> None:
    guard = Guard(most)
    for error, dt, resting in steps:
        share = guard.keep(error, dt, resting=resting)
        assert 0.0 <= share <= 1.0
        assert share * error <= most * (1 + 1e-12)


@given(most, st.lists(st.floats(0.0, 1.0)))
def test_an_error_within_the_limit_is_left_alone(most: float, shares: list[float]) -> None:
    guard = Guard(most)
    assert all(guard.keep(most * x, 0.01, resting=True) == 1.0 for x in shares)


@given(most)
def test_held_back_and_let_go_it_comes_to_the_vehicle_and_is_done(most: float) -> None:
    guard, error, seconds = Guard(most), 2 * most, 0.0
    error *= guard.keep(error, 0.01, resting=False)
    while guard.held_back and seconds < 10 * GIVE_IN_S:
        error *= guard.keep(error, 0.01, resting=True)
        seconds += 0.01
    assert not guard.held_back
    assert error <= most / 10
    assert guard.keep(error, 0.01, resting=True) == 1.0
