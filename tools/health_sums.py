"""What a report needs of the `Health` messages of each service, in a memory that does not grow.

Health counts since the start of a process; when `sent` decreases, the service was restarted, and
its counts from before are added.
"""

from collections import Counter

import msgspec

from messages.health import Health

MOST = 2000  # values that are kept for a median: each second of the first half hour
LATE_NS = 5_000_000_000  # [ns] a message that is older than the one before it was overtaken


class Thinned(msgspec.Struct):
    """Values for a median: all of them, and from `MOST` on every second, every fourth …"""

    values: list[float] = []
    every: int = 1  # one of so many is kept
    seen: int = 0

    def add(self, value: float | None) -> None:
        if value is None:
            return
        if self.seen % self.every == 0:
            self.values.append(value)
        self.seen += 1
        if len(self.values) > MOST:
            self.values = self.values[::2]
            self.every *= 2


class HealthSums(msgspec.Struct):
    """Of one service, over its restarts."""

    last: Health | None = None
    lives: int = 0  # times it was started, as far as its messages tell
    lateness_p50_ms: Thinned = msgspec.field(default_factory=Thinned)  # [ms] of each second
    lateness_p99_ms: Thinned = msgspec.field(default_factory=Thinned)  # [ms] of each second
    cpu_percent: float = 0.0  # [%] of one core, sum over its messages
    cpu_times: int = 0  # messages in that sum
    rss_mb: float | None = None  # [MB] most
    sent_before: int = 0  # messages, in the lives before this one
    counts_before: dict[str, int] = {}  # the same of its counts

    def add(self, health: Health) -> None:
        self._of_the_second(health)
        last = self.last
        if last is not None and last.stamp_ns - LATE_NS < health.stamp_ns < last.stamp_ns:
            return
        if last is None:
            self.lives = 1
        elif health.sent < last.sent:
            self.lives += 1
            self.sent_before, self.counts_before = self.sent, dict(self.counts)
        self.last = health

    @property
    def sent(self) -> int:
        """Messages."""
        return self.sent_before + (0 if self.last is None else self.last.sent)

    @property
    def counts(self) -> Counter[str]:
        """Everything that it counted, by name."""
        counts = Counter(self.counts_before)
        if self.last is not None:
            counts.update(self.last.counts)
        return counts

    @property
    def mean_cpu_percent(self) -> float | None:
        """[%] of one core; None: never known."""
        return self.cpu_percent / self.cpu_times if self.cpu_times else None

    def _of_the_second(self, health: Health) -> None:
        self.lateness_p50_ms.add(health.lateness_p50_ms)
        self.lateness_p99_ms.add(health.lateness_p99_ms)
        if health.cpu_percent is not None:
            self.cpu_percent += health.cpu_percent
            self.cpu_times += 1
        if health.rss_mb is not None:
            self.rss_mb = max(health.rss_mb, self.rss_mb or 0.0)


class HealthOfAll:
    """By service."""

    def __init__(self) -> None:
        self.sums: dict[str, HealthSums] = {}

    def add(self, health: Health) -> None:
        self.sums.setdefault(health.service, HealthSums()).add(health)
