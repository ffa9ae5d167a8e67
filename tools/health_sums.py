"""What a report needs of the `Health` messages of each service, in a memory that does not grow.

Health counts since the start of a process. Another instance, or a smaller `sent`, is a restart:
what was counted before is added. Anybody who may report health can invent names and instances: no
more are kept than fit.
"""

from collections import Counter
from collections.abc import Iterable, Mapping

import msgspec

from messages import events
from messages.health import Health
from messages.payload import MEMBERS

MOST = 2000  # instances of a service
LATE_NS = 5_000_000_000  # [ns] a message that is older than the one before it was overtaken
MOST_NAMES = 1000  # counts by name, of one service
OTHERS = "others"  # services beyond those that a port takes
UNCOUNTED = events.UNCOUNTED("others").name


def summed(each: Iterable[Mapping[str, int]]) -> Counter[str]:
    """Counts by name, added up within their bounds."""
    total = Counter[str]()
    for counts in each:
        for name, count in counts.items():
            kept = name if name in total or len(total) < MOST_NAMES else UNCOUNTED
            total[kept] += count
    return total


class OneProcess(msgspec.Struct):
    """One process of a service."""

    last: Health
    counted_before: dict[str, int]  # what it had counted when it was first heard, left out
    first_said: int  # number of its first message among all of the service …
    last_said: int  # … and of its newest

    @property
    def counts(self) -> Counter[str]:
        """Since it was first heard."""
        return Counter(self.last.counts) - Counter(self.counted_before)


class HealthSums(msgspec.Struct):
    """Of one service, over its restarts. Of every process by itself: two topsides have services of
    the same names, and report them by turns."""

    joined: bool = False  # whoever listens came later: what was counted before that is left out
    living: dict[int, OneProcess] = {}  # by `Health.instance`
    said: int = 0  # messages
    ended: int = 0  # processes that ended, and began again with the same instance
    lateness_p50_ms: list[float] = []  # [ms] of each second
    lateness_p99_ms: list[float] = []  # [ms] of each second
    cpu_percent: float = 0.0  # [%] of one core, sum over its messages
    cpu_times: int = 0  # messages in that sum
    rss_mb: float | None = None  # [MB] most
    sent_before: int = 0  # messages, in the lives that have ended
    counts_before: dict[str, int] = {}  # the same of its counts

    def add(self, health: Health) -> None:
        self._of_the_second(health)
        self.said += 1
        # Somebody who invents instances is counted as one.
        known = health.instance in self.living or len(self.living) < MOST
        instance = health.instance if known else -1
        life = self.living.get(instance)
        if life is None:
            before = health.counts if self.joined and health.seq > 0 else {}
            self.living[instance] = OneProcess(health, before, self.said, self.said)
            return
        life.last_said = self.said
        if life.last.stamp_ns - LATE_NS < health.stamp_ns < life.last.stamp_ns:
            return
        if health.sent < life.last.sent:
            self.ended += 1
            self.sent_before += life.last.sent
            self.counts_before = dict(summed([self.counts_before, life.counts]))
            life.counted_before = {}
        life.last = health

    @property
    def side(self) -> str:
        """Its home; empty: not known."""
        return next((life.last.side for life in self.living.values()), "")

    @property
    def lives(self) -> int:
        """Times that it was started, as far as its messages tell."""
        return len(self.living) + self.ended

    @property
    def restarts(self) -> int:
        """The same without the first start of each that ran beside others."""
        spans = [(life.first_said, life.last_said) for life in self.living.values()]
        beside = (sum(a <= begin <= b for a, b in spans) for begin, _ in spans)
        return max(0, self.lives - max(beside, default=1))

    @property
    def sent(self) -> int:
        """Messages."""
        return self.sent_before + sum(life.last.sent for life in self.living.values())

    @property
    def counts(self) -> Counter[str]:
        """Everything that it counted, by name."""
        return summed([self.counts_before, *(life.counts for life in self.living.values())])

    @property
    def mean_cpu_percent(self) -> float | None:
        """[%] of one core; None: never known."""
        return self.cpu_percent / self.cpu_times if self.cpu_times else None

    def _of_the_second(self, health: Health) -> None:
        for kept, late_ms in (
            (self.lateness_p50_ms, health.lateness_p50_ms),
            (self.lateness_p99_ms, health.lateness_p99_ms),
        ):
            if late_ms is not None:
                kept.append(late_ms)
        if health.cpu_percent is not None:
            self.cpu_percent += health.cpu_percent
            self.cpu_times += 1
        if health.rss_mb is not None:
            self.rss_mb = max(health.rss_mb, self.rss_mb or 0.0)


class HealthOfAll:
    """By service.

    Args:
        joined: services may have run before anybody listened here, as those of a drone have when a
            topside joins.
    """

    def __init__(self, *, joined: bool = False) -> None:
        self.sums: dict[str, HealthSums] = {}
        self._joined = joined

    def add(self, health: Health) -> None:
        # A port takes messages of so many names; what they say of their service may be invented.
        known = health.service in self.sums or len(self.sums) < MEMBERS
        name = health.service if known else OTHERS
        sums = self.sums.setdefault(name, HealthSums(joined=self._joined))
        sums.add(health)
