"""What is kept of health messages: as much as the whole list would tell."""

from collections import Counter
from itertools import pairwise

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.health import Health
from messages.payload import MEMBERS
from tools.health_sums import MOST_NAMES, HealthOfAll, HealthSums

S = 1_000_000_000  # [ns]


def health(second: int, sent: int, counts: dict[str, int], cpu_percent: float | None) -> Health:
    return Health(
        stamp_ns=second * S, service="control", loop_hz=100.0, lateness_p50_ms=0.1 * second,
        lateness_p99_ms=None, cpu_percent=cpu_percent, rss_mb=float(second % 7), sent=sent,
        received=0, counts=counts,
    )  # fmt: skip


COUNTS = st.dictionaries(st.sampled_from(["stale", "lost:state"]), st.integers(0, 9))
SAID = st.lists(st.tuples(st.integers(0, 1000), COUNTS, st.none() | st.floats(0.0, 400.0)))


@given(SAID)
def test_the_sums_are_those_of_the_whole_list(said: list[tuple[int, dict[str, int], float | None]]):
    reports = [health(second, *one) for second, one in enumerate(said)]
    sums = HealthSums()
    for report in reports:
        sums.add(report)
    ends = [a for a, b in pairwise(reports) if b.sent < a.sent] + reports[-1:]
    assert sums.sent == sum(end.sent for end in ends)
    assert sums.lives == len(ends)
    assert sums.counts == sum((Counter(end.counts) for end in ends), Counter[str]())
    known = [report.cpu_percent for report in reports if report.cpu_percent is not None]
    assert sums.mean_cpu_percent == (pytest.approx(sum(known) / len(known)) if known else None)
    assert sums.rss_mb == max((report.rss_mb or 0.0 for report in reports), default=None)
    assert sums.lateness_p50_ms == [report.lateness_p50_ms for report in reports]
    again = msgspec.json.decode(msgspec.json.encode(sums), type=HealthSums)
    assert again == sums


@given(SAID.filter(bool), st.booleans())
def test_who_joins_later_counts_from_then_on(
    said: list[tuple[int, dict[str, int], float | None]], late: bool
):
    reports = [health(second, *one) for second, one in enumerate(said)]
    numbered = [replace(report, seq=number + late) for number, report in enumerate(reports)]
    sums, all_of_it = HealthSums(joined=True), HealthSums()
    for report in numbered:
        sums.add(report)
        all_of_it.add(report)
    lives = all_of_it.counts
    first_life = next((a for a, b in pairwise(reports) if b.sent < a.sent), reports[-1])
    before = Counter(reports[0].counts) if late else Counter[str]()
    since = Counter(first_life.counts) - before
    assert sums.counts == lives - Counter(first_life.counts) + since


def test_an_overtaken_message_is_no_restart():
    sums = HealthSums()
    for second, sent in [(1, 10), (3, 30), (2, 20), (4, 40)]:
        sums.add(health(second, sent, {}, None))
    assert (sums.lives, sums.sent) == (1, 40)


def test_invented_names_of_counts_and_services_are_kept_under_one_name() -> None:
    everyone = HealthOfAll()
    for k in range(3):
        invented = {f"stale:{k}-{n}": 1 for n in range(MOST_NAMES)}
        everyone.add(replace(health(k, 3 - k, invented, None), service="gamepad"))
    counts = everyone.sums["gamepad"].counts
    assert len(counts) <= MOST_NAMES + 1
    assert sum(counts.values()) == 3 * MOST_NAMES
    for k in range(5 * MEMBERS):
        everyone.add(replace(health(1, 1, {}, None), service=f"invented-{k}"))
    assert len(everyone.sums) <= MEMBERS + 1
