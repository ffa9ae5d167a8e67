"""Time by sensor stamps, whatever the clock and the stamps do."""

from hypothesis import given
from hypothesis import strategies as st

from services.marine.sensor_time import PATIENCE_NS, SensorTime

MS = 1_000_000  # [ns]
# Clock since the step before, and the age of the sample [ms]; None: no new sample.
steps = st.lists(
    st.tuples(st.integers(0, 300), st.one_of(st.none(), st.integers(0, 200))), min_size=1
)


@given(st.lists(st.tuples(st.integers(1, 40), st.integers(0, 300)), min_size=2))
def test_with_new_stamps_only_they_count_and_not_when_they_are_handled(
    samples: list[tuple[int, int]],
) -> None:
    time, stamp, now = SensorTime(), 0, 0
    for period, delay in samples:
        stamp += period * MS
        now = max(now, stamp + delay * MS)
        assert time.step(stamp, now) == stamp


@given(steps)
def test_it_never_runs_backwards_nor_ahead_of_the_clock_nor_loses_time(
    moves: list[tuple[int, int | None]],
) -> None:
    """Never ahead of the clock: so nothing is counted twice. Never behind the newest stamp."""
    time, now, newest, before = SensorTime(), 1000 * MS, 0, 0
    for wait, age in moves:
        now += wait * MS
        newest = newest if age is None else max(newest, now - age * MS)
        at = time.step(newest or None, now)
        assert before <= at <= now
        assert at >= newest
        before = at


def test_in_silence_it_goes_on_by_the_clock_and_returns_without_a_jump() -> None:
    time, late, last = SensorTime(), 30 * MS, 0
    for k in range(10):
        last = time.step(k * 10 * MS, k * 10 * MS + late)
    assert time.step(90 * MS, 90 * MS + late + PATIENCE_NS) == last
    silent = [time.step(90 * MS, k * 10 * MS + late) for k in range(15, 30)]
    assert silent == [k * 10 * MS for k in range(15, 30)]
    assert time.step(300 * MS, 300 * MS + late) == 300 * MS


def test_a_sensor_that_begins_to_count_anew_costs_no_time_and_adds_none() -> None:
    time = SensorTime()
    time.step(5000 * MS, 5000 * MS)
    assert time.step(10 * MS, 5040 * MS) == 5040 * MS
    assert time.step(20 * MS, 5055 * MS) == 5050 * MS


def test_without_a_sample_it_goes_on_by_the_clock_at_once() -> None:
    time = SensorTime()
    time.step(1000 * MS, 1000 * MS)
    assert time.step(None, 1010 * MS) == 1010 * MS
    assert time.step(1020 * MS, 1020 * MS) == 1020 * MS
