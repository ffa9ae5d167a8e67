"""Loop statistics of a service: its `Health` message, gathered between two reports."""

from collections import Counter
from dataclasses import dataclass

from messages.health import Health

NAME, NAMES = 128, 1000  # characters of a name, and names, that a health message holds


@dataclass(frozen=True, slots=True)
class Usage:
    """What the operating system says of this process, or of this node's share of it."""

    cpu_s: float  # [s] processor time since start
    rss_mb: float  # [MB] resident memory, always of the process


@dataclass(frozen=True, slots=True)
class Instance:
    """Which process a node is in."""

    number: int = 0  # drawn at its start; 0: on virtual time
    pid: int = 0


class LoopStats:
    """Counts handler calls and how late each began."""

    def __init__(self) -> None:
        self._lateness: list[int] = []  # [ns] of every call since the last report
        self._reported_at: int | None = None
        self._cpu_s = 0.0

    def handled(self, late_ns: int) -> None:
        self._lateness.append(late_ns)

    def report(
        self,
        service: str,
        now: int,
        sent: int,
        received: int,
        counts: Counter[str],
        usage: Usage | None,
        side: str = "",
        instance: Instance = Instance(),
    ) -> Health:
        """Health over the period since the last report; a new period begins."""
        since = self._reported_at  # the same instant: reports of a stalled process in a row
        seconds = 1.0 if since is None or now <= since else (now - since) / 1e9
        lateness = sorted(self._lateness)
        cpu = None if usage is None else 100.0 * (usage.cpu_s - self._cpu_s) / seconds
        health = Health(
            stamp_ns=now,
            service=service,
            loop_hz=len(lateness) / seconds,
            lateness_p50_ms=_percentile_ms(lateness, 50),
            lateness_p99_ms=_percentile_ms(lateness, 99),
            cpu_percent=cpu,
            rss_mb=None if usage is None else usage.rss_mb,
            sent=sent,
            received=received,
            counts=_bounded(counts),
            side=side,
            pid=instance.pid,
            instance=instance.number,
        )
        self._lateness = []
        self._reported_at = now
        self._cpu_s = 0.0 if usage is None else usage.cpu_s
        return health


def _bounded(counts: Counter[str]) -> dict[str, int]:
    """As many counts as a message may hold, names cut to what it may hold. Others are summed up."""
    bounded: Counter[str] = Counter()
    for number, (name, count) in enumerate(counts.items()):
        bounded[name[:NAME] if number < NAMES - 1 else "uncounted:others"] += count
    return dict(bounded)


def _percentile_ms(ordered: list[int], percent: int) -> float | None:
    if not ordered:
        return None
    return max(0, ordered[len(ordered) * percent // 100]) / 1e6
