"""A board's clock on the logger's: never after the arrival, and straight where the crystals are."""

from hypothesis import given
from hypothesis import strategies as st

from tools.importing.contradictions import gaps
from tools.importing.streams import LoggerClock, by_logger, pace

S = 1_000_000_000  # [ns]
steps = st.integers(1_000_000, 400_000_000)  # [ns] between two samples
delays = st.integers(0, 300_000_000)  # [ns]


@given(st.lists(st.tuples(steps, delays), min_size=1, max_size=200), st.floats(-1e-4, 1e-4))
def test_nothing_arrives_before_it_was_measured(
    samples: list[tuple[int, int]], drift: float
) -> None:
    heard: list[tuple[int, int]] = []
    stamp = 0
    for step, delay in samples:
        stamp += step
        heard.append((stamp, 10**18 + round(stamp * (1.0 + drift)) + delay))
    found = by_logger(*zip(*heard, strict=True))
    assert all(ours <= arrival for ours, (_, arrival) in zip(found, heard, strict=True))
    assert found == sorted(found)


@given(st.floats(-1e-4, 1e-4), st.integers(1, 50))
def test_where_one_in_some_comes_without_delay_the_offset_is_exact(drift: float, late: int) -> None:
    stamps = [k * S // 100 for k in range(30 * 100)]
    true = [10**18 + round(stamp * (1.0 + drift)) for stamp in stamps]
    arrivals = [at + (0 if k % late == 0 else 5_000_000) for k, at in enumerate(true)]
    found = by_logger(stamps, arrivals)
    worst = max(abs(ours - at) for ours, at in zip(found, true, strict=True))
    assert worst < 550_000  # a bin of 5 s at 100 ppm is the last


def test_a_board_that_starts_again_has_two_clocks() -> None:
    stamps = [*range(0, 20 * S, S)] * 2
    arrivals = [10**18 + stamp + (30 * S if k >= 20 else 0) for k, stamp in enumerate(stamps)]
    assert by_logger(stamps, arrivals) == arrivals
    assert pace(stamps, arrivals) == 1.0


def test_a_logger_s_clock_that_steps_back_goes_on() -> None:
    clock = LoggerClock()
    began = 1_700_000_000 * S
    found = [clock.arrival(began + k * S) for k in (0, 10, 4, 5, 6)]
    assert [(at - began) // S for at in found] == [0, 10, 10, 11, 12]
    assert clock.set_at == [(10.0, -6.0)]


def test_what_was_written_a_little_out_of_order_is_no_step() -> None:
    clock = LoggerClock()
    began = 1_700_000_000 * S
    found = [clock.arrival(began + k * S // 10) for k in (0, 3, 2, 4)]
    assert [(at - began) * 10 // S for at in found] == [0, 3, 3, 4]
    assert clock.set_at == []


def test_a_pause_is_a_gap_only_where_it_is_long_for_that_stream() -> None:
    fast = [k * S // 50 for k in range(100)]
    assert [each.tolist() for each in gaps(fast)] == [[], []]
    assert [each.tolist() for each in gaps([*fast, fast[-1] + S])] == [[100], [1.0]]
    assert [each.tolist() for each in gaps([k * S for k in range(100)])] == [[], []]
    assert [each.tolist() for each in gaps([])] == [[], []]
