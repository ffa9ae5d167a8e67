"""What the soak calls growing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.long.soak import BOUNDS, LEAST_S, YOUNG_S, Growth, Life, Sample, growth, growths

SLOPE = st.floats(-100.0, 100.0)  # [1/h]


@given(SLOPE, st.floats(-1e3, 1e3), st.lists(st.floats(0.0, 1e4), min_size=3, unique=True))
def test_the_growth_of_a_line_is_its_slope(slope: float, begin: float, times: list[float]):
    if max(times) - min(times) < 1.0:
        return
    found = growth("a", "threads", times, [begin + slope * at / 3600.0 for at in times])
    assert found.per_hour == pytest.approx(slope, abs=1e-3 + 1e-6 * abs(slope))
    assert found.whole == pytest.approx(slope * (max(times) - min(times)) / 3600.0, abs=1e-2)


@pytest.mark.parametrize(
    ("per_hour", "seconds", "too_fast"),
    [(60.0, 300.0, True), (-60.0, 300.0, False), (60.0, 100.0, False), (10.0, 3000.0, False)],
)
def test_only_what_grows_fast_and_by_more_than_chance_is_too_fast(
    per_hour: float, seconds: float, too_fast: bool
):
    grown = Growth("control", "memory [MB]", per_hour, per_hour * seconds / 3600.0)
    assert grown.too_fast == too_fast


@given(st.floats(0.0, 300.0))
def test_a_young_or_short_life_tells_nothing(lived_s: float):
    """A process takes its memory at its start."""
    times = [lived_s * k / 50 for k in range(51)]
    samples = [Sample(at, 50.0 if at >= YOUNG_S else at, 9, 3) for at in times]
    found = list(growths({Life("control", 7): samples}))
    if lived_s < LEAST_S + YOUNG_S:
        assert found == []
    for one in found:
        assert one.per_hour == pytest.approx(0.0, abs=1e-6)
        assert one.what in BOUNDS
