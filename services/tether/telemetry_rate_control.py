"""Telemetry rate control: the rates at which telemetry goes up a link that cannot carry all of it.

A pure function of what the link carries and what is offered to it. The picture comes first: a
usable one has its room before telemetry has more than its floors. What is left for telemetry is
divided by the weights and floors of the topic table. Nothing on the topside controls the vehicle by
the thinned topics; on board they keep their full rate.
"""

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from messages import topics
from services.marine.summation import plain_sum

THINNED = {topic.key: topic for topic in topics.ALL if topic.weight > 0.0}
ROOM = 0.85  # [-] share of what the link carries that may be planned with
PICTURES = (topics.VIDEO.key, topics.FURTHER_VIDEO.key)
PICTURE_KBIT = 1900.0  # [kbit/s] that pictures are left first; a quarter of it is headroom …
FLOORS = 0.36  # [-] … but so much of what the link carries is telemetry's, if its floors need it
LEAST = 0.1  # [-] of its floor that a stream keeps whatever there is
PICTURE_NS = 5_000_000_000  # [ns] without a part of a picture: none crosses
WORTHWHILE = 0.15  # [-] by which a rate changes at least
PERIODS = 10  # that are averaged: as long as two messages of the slowest topics
ENDLESS = 1e9  # [Hz] per weight

Period = tuple[float, dict[str, int]]  # [s] how long it was; [B] that were offered, by topic


def limits(budget_kbit: float, offered: Mapping[str, float]) -> dict[str, float]:
    """[1/s] Topics that are thinned out, and to what rate.

    Args:
        budget_kbit: [kbit/s] for all telemetry.
        offered: [kbit/s] load of each topic at its full rate; `""` is the sum of all topics that
            are never thinned.
    """
    low, high = 0.0, ENDLESS  # [Hz] per weight: the least that is known to be too much
    if load_kbit(_rates(high), offered) <= budget_kbit:
        return {}
    for _ in range(60):
        middle = (low + high) / 2.0
        if load_kbit(_rates(middle), offered) <= budget_kbit:
            low = middle
        else:
            high = middle
    rates = _rates(low)
    over = load_kbit(rates, offered) - budget_kbit  # [kbit/s] that not even the floors leave
    for key, topic in sorted(THINNED.items(), key=lambda each: each[1].weight):
        if over > 0.0 and (load := offered.get(key, 0.0)) > 0.0:
            kept = max(LEAST * rates[key], rates[key] - over / load * topic.hz)
            over -= (rates[key] - kept) / topic.hz * load
            rates[key] = kept
    return {key: hz for key, hz in rates.items() if hz < THINNED[key].hz}


def floors_kbit(offered: Mapping[str, float]) -> float:
    """[kbit/s] Load with every thinned topic at its floor."""
    return load_kbit(_rates(0.0), offered)


def load_kbit(rates: Mapping[str, float], offered: Mapping[str, float]) -> float:
    """[kbit/s] Load of the link at these rates [1/s]."""
    return plain_sum(
        kilobits * (rates[key] / THINNED[key].hz if key in rates else 1.0)
        for key, kilobits in offered.items()
    )


def _rates(per_weight: float) -> dict[str, float]:
    """[1/s] By weight, but no less than the floor and no more than there is."""
    return {
        key: min(topic.hz, max(topic.floor_hz, per_weight * topic.weight))
        for key, topic in THINNED.items()
    }


@dataclass(slots=True)
class TelemetryRateControl:
    """Thins topics to the rates in force, and measures the load that was offered."""

    rates: dict[str, float] = field(default_factory=dict[str, float])  # [1/s] by key
    _due: dict[str, int] = field(default_factory=dict[str, int])  # [ns]
    _bytes: dict[str, int] = field(default_factory=dict[str, int])  # of the period
    _since: int | None = None  # [ns]
    _periods: deque[Period] = field(default_factory=lambda: deque[Period](maxlen=PERIODS))
    _picture_ns: int | None = None  # [ns] when a part of a picture entered last

    def begin(self) -> None:
        """The link is new, and nothing is known of it but that its rate is limited."""
        self.rates = _rates(0.0)

    def judge(self, carries_kbit: float | None, now: int) -> bool:
        """At the end of a period: returns whether the rates have changed.

        Args:
            carries_kbit: [kbit/s] at which the link has carried what waited; None: nothing did.
        """
        self._measure(now)
        offered = self._offered()
        if carries_kbit is None or not offered:
            return False
        budget = ROOM * carries_kbit
        if self._picture_ns is not None and now < self._picture_ns + PICTURE_NS:
            least = min(FLOORS * carries_kbit, floors_kbit(offered))
            budget = max(budget - PICTURE_KBIT, least)
        new = limits(budget, offered)
        if new.keys() == self.rates.keys() and all(
            abs(hz - self.rates[key]) <= WORTHWHILE * self.rates[key] for key, hz in new.items()
        ):
            return False
        self.rates = new
        return True

    def admits(self, key: str, size: int, now: int) -> bool:
        """May this message of `size` bytes be sent?"""
        if key in PICTURES:  # less urgent than telemetry, and follows the link by itself
            self._picture_ns = now
            return True
        if self._since is None:
            self._since = now
        name = key if key in THINNED else ""
        self._bytes[name] = self._bytes.get(name, 0) + size
        if (hz := self.rates.get(key)) is None:
            return True
        if hz <= 0.0:
            return False
        period = round(1e9 / hz)
        due = self._due.get(key, now)
        if now < due:
            return False
        self._due[key] = max(due, now - period) + period
        return True

    def _measure(self, now: int) -> None:
        """A period has ended: what was offered in it counts."""
        seconds = 0.0 if self._since is None else (now - self._since) / 1e9
        if seconds > 0.0:
            self._periods.append((seconds, self._bytes))
        self._bytes, self._since = {}, now

    def _offered(self) -> dict[str, float]:
        """[kbit/s] By topic."""
        seconds = plain_sum(each for each, _ in self._periods)
        total = Counter[str]()
        for _, counted in self._periods:
            total.update(counted)
        return {key: count * 8e-3 / seconds for key, count in total.items()}
