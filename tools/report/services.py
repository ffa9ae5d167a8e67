"""Figures and counts of each service, from the `Health` that it publishes once a second."""

from collections.abc import Collection, Mapping

import msgspec
import numpy as np

from tools.health_sums import HealthSums

TOPSIDES = "supervisor_topside"  # each topside of two machines has one


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
    health: Mapping[str, HealthSums], restarts: dict[str, int], shared: Mapping[str, str]
) -> dict[str, Service]:
    """Every service with a health message or a restart.

    Args:
        restarts: as the supervisor counted them; a service without any health message is only here.
        shared: the process of each service that is not alone in a process of its own name.
    """
    # On board: a topside that came after another has new services, and none of them crashed.
    later = health.get(TOPSIDES, HealthSums()).restarts
    return {
        name: _service(
            health.get(name, HealthSums()), restarts.get(name, 0), shared.get(name), later
        )
        for name in sorted(set(health) | set(restarts))
    }


def _service(sums: HealthSums, restarts: int, process: str | None, topsides: int) -> Service:
    known = sums.restarts - (topsides if sums.side == "topside" else 0)
    cpu_percent = sums.mean_cpu_percent
    return Service(
        sent=sums.sent,
        lateness_p50_ms=_median(sums.lateness_p50_ms.values),
        lateness_p99_ms=_median(sums.lateness_p99_ms.values),
        cpu_percent=None if cpu_percent is None else round(cpu_percent, 1),
        rss_mb=sums.rss_mb,
        restarts=max(restarts, known),
        process=process,
    )


def _median(values: Collection[float]) -> float | None:
    return round(float(np.median([*values])), 3) if values else None
