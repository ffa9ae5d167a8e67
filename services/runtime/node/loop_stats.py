"""Loop statistics of a service: its `Health` message, gathered between two reports."""

from collections import Counter
from dataclasses import dataclass

from messages import events
from messages.health import LATE_MS, Health

NAME, NAMES = 128, 1000  # characters of a name, and names, that a health message holds
# [ns] A single call later than this is a stall. A port of a stream at 100 Hz keeps the newest
# 16 messages: the first of them is 0.15 s late, however much longer the stall was.
STALLED_NS = 140_000_000
UNCOUNTED = events.UNCOUNTED("others").name
CALM_NS = 10_000_000_000  # [ns] the same so soon after the last time is not said again


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
        self.handled = self._lateness.append  # a handler was called so late [ns]
        self._late_at: int | None = None  # [ns] newest report of a late period
        self._reported_at: int | None = None
        self._cpu_s: float | None = None  # [s] at the last report; None: before the first

    def behind(self, now: int) -> tuple[bool, str]:
        """Before a report: was there a stall in its period, and what is to be said; empty: nothing
        new. The first period, in which a service starts, is not judged."""
        if self._reported_at is None or not self._lateness:
            return False, ""
        worst, p99 = max(self._lateness), _percentile_ms(sorted(self._lateness), 99) or 0.0
        stalled = worst > STALLED_NS
        if not stalled and p99 <= LATE_MS:
            return False, ""
        before, self._late_at = self._late_at, now
        if before is not None and now - before < CALM_NS:
            return stalled, ""
        why = "the computer is too busy, or it was stopped"
        return (
            stalled,
            f"runs {worst / 1e9:.2f} s behind or more: {why}",
        )

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
        cpu = None  # of the first period nothing is known: it would count the imports
        if usage is not None and self._cpu_s is not None:
            cpu = 100.0 * (usage.cpu_s - self._cpu_s) / seconds
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
        self._lateness.clear()
        self._reported_at = now
        self._cpu_s = None if usage is None else usage.cpu_s
        return health


def _bounded(counts: Counter[str]) -> dict[str, int]:
    """As many counts as a message may hold, names cut to what it may hold. Others are summed up."""
    bounded: Counter[str] = Counter()
    for number, (name, count) in enumerate(dict(counts).items()):  # other threads count on
        bounded[name[:NAME] if number < NAMES - 1 else UNCOUNTED] += count
    return dict(bounded)


def _percentile_ms(ordered: list[int], percent: int) -> float | None:
    if not ordered:
        return None
    return max(0, ordered[len(ordered) * percent // 100]) / 1e6
