"""Whether a DVL still sees the bottom that it saw before, by altitudes alone."""

from hypothesis import given
from hypothesis import strategies as st

from services.estimation.aids import (
    ALTITUDE_JUMP,
    LONGEST_ALTITUDE,
    STEEPEST,
    SWIMS,
    BottomLock,
)

S = 1_000_000_000  # [ns]
ODD, FITS = SWIMS**2 + 1.0, 1.0  # surprises


def locked(altitude: float = 5.0) -> BottomLock:
    lock = BottomLock()
    lock.see(altitude, S, 0.0)
    lock.take()
    return lock


@given(
    st.lists(
        st.tuples(
            st.floats(0.01, LONGEST_ALTITUDE),  # [s] since the sample before
            st.floats(0.0, 3.0),  # [m/s]
            st.floats(-STEEPEST, STEEPEST),  # slope
            st.floats(-1.0, 1.0),  # [m] that the vehicle sinks
        )
    )
)
def test_no_slope_and_no_dive_looks_like_fish(
    legs: list[tuple[float, float, float, float]],
) -> None:
    lock, at, altitude = locked(100.0), float(S), 100.0
    for seconds, speed, slope, sunk in legs:
        at += seconds * S
        altitude -= 0.99 * slope * speed * seconds + sunk
        lock.sink(sunk)
        lock.see(altitude, round(at), speed)
        assert not lock.swims(1e9, 2 * S)


@given(st.floats(0.0, 100.0), st.floats(0.0, 1e9), st.floats(0.0, 1e9))
def test_a_jump_with_a_velocity_that_goes_on_is_a_step(to: float, odd: float, later: float) -> None:
    lock = locked()
    lock.see(to, S + S // 10, 0.0)
    assert not lock.swims(min(odd, SWIMS**2), 2 * S)
    lock.take()
    lock.see(to, S + S // 5, 0.0)
    assert not lock.swims(later, 2 * S)


def test_fish_are_rejected_until_the_bottom_is_back() -> None:
    lock = locked()
    lock.see(2.0, S + S // 10, 0.0)
    assert lock.swims(ODD, 2 * S)
    lock.see(2.0, S + S // 5, 0.0)
    assert lock.swims(FITS, 2 * S)  # the estimate knows less by then: that it fits says nothing
    lock.see(5.0 - ALTITUDE_JUMP / 2, S + 3 * S // 10, 0.0)
    assert not lock.swims(ODD, 2 * S)


def test_without_an_altitude_or_after_a_gap_nothing_is_said() -> None:
    lock = locked()
    lock.see(None, S + S // 10, 0.0)
    assert not lock.swims(ODD, 2 * S)
    lock.see(2.0, S + S // 5, 0.0)
    assert not lock.swims(ODD, 2 * S)
    lock = locked()
    lock.see(2.0, S + round((LONGEST_ALTITUDE + 0.1) * S), 0.0)
    assert not lock.swims(ODD, 2 * S)


def test_what_is_used_after_all_is_the_bottom() -> None:
    lock = locked()
    lock.see(2.0, S + S // 10, 0.0)
    assert lock.swims(ODD, 2 * S)
    lock.take()
    lock.see(2.0, S + S // 5, 0.0)
    assert not lock.swims(ODD, 2 * S)
