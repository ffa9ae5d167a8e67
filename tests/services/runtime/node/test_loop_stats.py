"""A service's own report: rates and lateness of the period since the last one, nothing kept."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.health import Health
from services.runtime.node.loop_stats import LoopStats, Usage

SECOND = 1_000_000_000
LATE = st.integers(-1_000, 10 * SECOND)  # [ns]; slightly early is possible by rounding


def report(stats: LoopStats, now: int = SECOND, usage: Usage | None = None) -> Health:
    return stats.report("control", now, 3, 4, Counter(stale=2), usage)


def of(lateness: list[int]) -> Health:
    stats = LoopStats()
    for late in lateness:
        stats.handled(late)
    return report(stats)


@given(st.lists(LATE, min_size=1, max_size=300))
def test_percentiles_are_values_that_occurred_in_order_and_never_negative(
    lateness: list[int],
) -> None:
    health = of(lateness)
    happened = {max(0, late) / 1e6 for late in lateness}
    assert health.lateness_p50_ms in happened
    assert health.lateness_p99_ms in happened
    assert health.lateness_p50_ms is not None
    assert health.lateness_p99_ms is not None
    assert 0.0 <= health.lateness_p50_ms <= health.lateness_p99_ms <= max(happened)
    below = sum(max(0, late) / 1e6 < health.lateness_p50_ms for late in lateness)
    above = sum(max(0, late) / 1e6 > health.lateness_p50_ms for late in lateness)
    assert max(below, above) <= len(lateness) / 2 + 1


@given(st.lists(LATE, max_size=30), st.lists(LATE, max_size=30), st.integers(1, 100))
def test_each_report_is_about_its_own_period(
    first: list[int], second: list[int], seconds: int
) -> None:
    stats = LoopStats()
    for late in first:
        stats.handled(late)
    report(stats)
    for late in second:
        stats.handled(late)
    health = report(stats, (1 + seconds) * SECOND)
    assert health.loop_hz == pytest.approx(len(second) / seconds)
    again = of(second)
    assert (health.lateness_p50_ms, health.lateness_p99_ms) == (
        again.lateness_p50_ms,
        again.lateness_p99_ms,
    )


def test_processor_time_is_a_share_of_the_period_and_counts_are_a_copy() -> None:
    stats, counts = LoopStats(), Counter(stale=1)
    first = report(stats, SECOND, Usage(cpu_s=5.0, rss_mb=40.0))
    assert (first.cpu_percent, first.rss_mb) == (None, 40.0)  # it would count the imports
    health = stats.report("control", 3 * SECOND, 3, 4, counts, Usage(cpu_s=5.5, rss_mb=41.0))
    assert (health.cpu_percent, health.rss_mb) == (25.0, 41.0)
    counts["stale"] += 1
    assert health.counts == {"stale": 1}
