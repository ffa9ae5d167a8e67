"""Figures and counts of each service, from the `Health` that it publishes once a second.

Health counts since the start of a process; when `sent` decreases, the service was restarted, and
its counts from before are added.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import pairwise

import msgspec
import numpy as np

from messages.health import Health


class Service(msgspec.Struct, frozen=True):
    """Figures over a dive. None: not known, as on virtual time."""

    sent: int  # messages
    lateness_p50_ms: float | None  # [ms] median over the seconds of each second's median
    lateness_p99_ms: float | None  # [ms] median over the seconds of each second's 99th percentile
    cpu_percent: float | None  # [%] of one core, mean
    rss_mb: float | None  # [MB] most
    restarts: int  # with its process
    process: str | None  # the OS process it shares with others; None: one of its own


def services(
    health: dict[str, list[Health]], restarts: dict[str, int], shared: Mapping[str, str]
) -> dict[str, Service]:
    """Every service with a health message or a restart.

    Args:
        restarts: as the supervisor counted them; a service without any health message is only here.
        shared: the process of each service that is not alone in a process of its own name.
    """
    names = sorted(set(health) | set(restarts))
    return {
        name: _service(health.get(name, []), restarts.get(name, 0), shared.get(name))
        for name in names
    }


def by_service(health: Mapping[str, list[Health]]) -> dict[str, Counter[str]]:
    """What each service counted, summed by name over its restarts, and over two topsides."""
    counts: dict[str, Counter[str]] = {}
    for name, reports in health.items():
        counts[name] = Counter()
        for last in _lives(reports):
            counts[name].update(last.counts)
    return counts


def _service(reports: list[Health], restarts: int, process: str | None) -> Service:
    lives = _lives(reports)
    return Service(
        sent=sum(last.sent for last in lives),
        lateness_p50_ms=_median(report.lateness_p50_ms for report in reports),
        lateness_p99_ms=_median(report.lateness_p99_ms for report in reports),
        cpu_percent=_mean(report.cpu_percent for report in reports),
        rss_mb=max((r.rss_mb for r in reports if r.rss_mb is not None), default=None),
        restarts=max(restarts, len(lives) - _side_by_side(reports)),
        process=process,
    )


def _lives(reports: list[Health]) -> list[Health]:
    """The last report of a service before each restart, and its last one. Of every process by
    itself: two topsides have services of the same names, and report them by turns."""
    lives: list[Health] = []
    for instance in dict.fromkeys(report.instance for report in reports):
        own = [report for report in reports if report.instance == instance]
        ordered = sorted(own, key=lambda report: report.stamp_ns)
        lives += [report for report, following in pairwise(ordered) if following.sent < report.sent]
        lives.append(ordered[-1])
    return lives


def _side_by_side(reports: list[Health]) -> int:
    """How many processes of one name there were at a time, by the order in which they spoke."""
    said = [report.instance for report in reports]
    spans = [(said.index(one), len(said) - said[::-1].index(one)) for one in dict.fromkeys(said)]
    return max((sum(a <= begin < b for a, b in spans) for begin, _ in spans), default=1)


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(float(np.median(known)), 3) if known else None


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(float(np.mean(known)), 1) if known else None
