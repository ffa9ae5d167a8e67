"""A sensor is silent by its own rate, and a change of rate or a hiccup is no silence."""

from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st

from services.marine.rhythm import LEAST_S, PERIODS, SampleRhythm

LONGEST = 5.0  # [s] as of `sensor/dvl`


def false_alarms(periods: Sequence[float]) -> int:
    """Periods [s] that would have been taken for a silence."""
    rhythm, t, alarms = SampleRhythm(LONGEST), 0.0, 0
    rhythm.see(0)
    for period in periods:
        alarms += period > rhythm.patience
        t += period
        rhythm.see(round(t * 1e9))
    return alarms


JITTER = st.floats(0.4, 1.6)


@given(st.lists(JITTER, min_size=1, max_size=60))
def test_once_a_second_with_jitter_is_alive(periods: list[float]) -> None:
    assert false_alarms(periods) == 0


@given(st.lists(st.tuples(st.sampled_from([15.0, 10.0, 8.0, 4.0, 2.0]), st.integers(1, 40), JITTER),
                max_size=20))  # fmt: skip
def test_a_change_of_the_range_mode_is_no_silence(parts: list[tuple[float, int, float]]) -> None:
    periods = [jitter / hz for hz, count, jitter in parts for _ in range(count)]
    assert false_alarms(periods) == 0


@given(st.floats(2.0, 26.0), st.lists(st.booleans(), max_size=100))
def test_hiccups_of_half_a_second_are_none(hz: float, hiccups: list[bool]) -> None:
    assert false_alarms([1.0 / hz + 0.5 * hiccup for hiccup in hiccups]) == 0


@given(st.floats(0.1, 30.0), st.integers(40, 80))
def test_it_is_silent_after_ten_periods(hz: float, count: int) -> None:
    rhythm = SampleRhythm(LONGEST)
    assert rhythm.patience == LONGEST
    for n in range(count):
        rhythm.see(round(n * 1e9 / hz))
    assert abs(rhythm.patience - min(LONGEST, max(LEAST_S, PERIODS / hz))) < 1e-6


def test_an_outage_is_forgotten() -> None:
    rhythm = SampleRhythm(LONGEST)
    for n in range(20):
        rhythm.see(n * 100_000_000)
    assert rhythm.patience == LEAST_S
    for n in range(20):
        rhythm.see(60_000_000_000 + n * 100_000_000)
    assert rhythm.patience < 1.1
