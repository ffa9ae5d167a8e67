"""How much somebody with a certificate may send to a hub: the budget of each role, and who has
used it up. Pure: what the operating system has counted, and `now`, are arguments.

A budget is a bucket that leaks: it fills with the bytes that all links of a certificate have sent,
and drains at the role's rate. Half full is a warning; full at a later look, and all links of that
certificate are cut off and none is taken for a while, longer each time. Bytes stand for messages,
liveliness tokens, subscriptions and questions alike, because nothing of that comes without any.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from services.runtime.bus.tcp_links import Ends

BARRED_S, LONGEST_BARRED_S = 10.0, 600.0  # [s] the first time; twice as long each further time


class Budget(NamedTuple):
    """Of one certificate."""

    rate: float  # [bytes/s] for ever
    burst: float  # [bytes] above that
    links: int  # at the same time


# An observer says that it lives and what it wants to hear. A topside sends 30 kB/s with every
# service that it has. A drone may have four cameras of 50 Mbit/s, and a router a fleet of drones.
BUDGETS = {
    "observer": Budget(8e3, 128e3, 8),
    "pilot": Budget(256e3, 1e6, 8),
    "drone": Budget(32e6, 64e6, 8),
    "router": Budget(32e6, 64e6, 8),
}
LEAST = BUDGETS["observer"]  # of who is not admitted: it may stay, and is neither heard nor told

What = Literal["warn", "cut"]


class Verdict(NamedTuple):
    """Of a certificate, since the last look."""

    name: str
    what: What
    why: str  # `too much` or `too many links`
    barred_s: float = 0.0  # [s] how long none of its links is taken


@dataclass(slots=True)
class Bucket:
    """Of one certificate."""

    budget: Budget
    filled: float = 0.0  # [bytes] in the bucket
    warned: bool = False
    times: int = 0  # it was cut off
    barred_until: int = 0  # [ns]


@dataclass(slots=True)
class Budgets:
    """Those of all who have come to a hub."""

    admitted: frozenset[str]
    buckets: dict[str, Bucket] = field(default_factory=dict[str, Bucket])
    _counted: dict[Ends, int] = field(default_factory=dict[Ends, int])  # [bytes] of each link
    _looked: int | None = None  # [ns]

    def look(
        self, links: Mapping[Ends, str], received: Mapping[Ends, int], now: int
    ) -> list[Verdict]:
        """What is to be done at `now` [ns].

        Args:
            links: name of the certificate of each link that there is.
            received: [bytes] that each has sent since it began.
        """
        elapsed_s = 0.0 if self._looked is None else (now - self._looked) / 1e9
        self._looked = now
        sent = dict.fromkeys(links.values(), 0)
        for link, name in links.items():
            sent[name] += max(0, received.get(link, 0) - self._counted.get(link, 0))
        # Where it could not be asked, as without free descriptors, the last count stays: from none
        # on, all that the link ever sent would count as sent at once.
        self._counted = {link: received.get(link, self._counted.get(link, 0)) for link in links}
        for bucket in self.buckets.values():
            bucket.filled = max(0.0, bucket.filled - bucket.budget.rate * elapsed_s)
        verdicts: list[Verdict] = []
        for name, count in sent.items():
            many = list(links.values()).count(name)
            verdict = _judged(name, self._bucket(name), count, many, now)
            verdicts += [] if verdict is None else [verdict]
        return verdicts

    def barred(self, name: str, now: int) -> bool:
        """Is nothing to be read of a link of this certificate that comes now? For any thread: it
        makes no bucket, while `look` may be going over them on another."""
        bucket = self.buckets.get(name)
        return bucket is not None and now < bucket.barred_until

    def beyond(self, links: Mapping[Ends, str], now: int) -> list[Ends]:
        """Links of those barred that are to be cut, although that brings them back at once: of each
        certificate the oldest beyond its number."""
        held: dict[str, list[Ends]] = {}
        for link, name in links.items():
            if self.barred(name, now):
                held.setdefault(name, []).append(link)
        return [
            link
            for name, own in held.items()
            for link in own[: max(0, len(own) - self._bucket(name).budget.links)]
        ]

    def _bucket(self, name: str) -> Bucket:
        if name not in self.buckets:
            role = name.partition(":")[0] if name in self.admitted else ""
            self.buckets[name] = Bucket(BUDGETS.get(role, LEAST))
        return self.buckets[name]


def _judged(name: str, bucket: Bucket, sent: int, links: int, now: int) -> Verdict | None:
    if now < bucket.barred_until:  # what it still sends counts for nothing
        return None
    bucket.filled += sent
    budget, many = bucket.budget, links > bucket.budget.links
    why = "too many links" if many else "too much"
    bucket.warned = bucket.warned and (many or bucket.filled > sent)  # else it had drained
    if not bucket.warned and (many or bucket.filled > budget.burst / 2):
        bucket.warned = True
        return Verdict(name, "warn", why)
    if many or bucket.filled > budget.burst:
        barred_s = min(LONGEST_BARRED_S, BARRED_S * 2 ** min(bucket.times, 10))
        bucket.filled, bucket.warned, bucket.times = 0.0, False, bucket.times + 1
        bucket.barred_until = now + round(barred_s * 1e9)
        return Verdict(name, "cut", why, barred_s)
    return None
