"""The link as a whole: both directions, changes, telemetry rate control and the status.

Telemetry rate control: the rates at which telemetry goes up a link that cannot carry all of it.

A pure function of what the link carries and what is offered to it. The picture comes first: a
usable one has its room before telemetry has more than its floors. What is left for telemetry is
divided by the weights and floors of the topic table. Nothing on the topside controls the vehicle by
the thinned topics; on board they keep their full rate.
"""

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from messages import topics
from messages.link import Clock, LinkStatus
from services.marine.summation import plain_sum
from services.tether.link_model import LinkDirection
from services.tether.profile import LinkProfile

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


T = TypeVar("T")


class Link(Generic[T]):
    """Messages of any type, down and up."""

    def __init__(self, name: str, profile: LinkProfile, seed: int) -> None:
        self.name = name
        self.down: LinkDirection[T] = LinkDirection(profile.down, np.random.default_rng(seed))
        self.up: LinkDirection[T] = LinkDirection(profile.up, np.random.default_rng(seed + 1))
        self.changes = 0  # since start
        self._profile = profile
        self._rate_control = TelemetryRateControl()
        self._judged = (0, 0)  # bytes carried, and the time that took [ns], until then
        self._begin()

    # Changes.

    def change(self, name: str, profile: LinkProfile, now: int) -> None:
        """Use another model from now on; messages on the link still arrive."""
        self.changes += 1
        self.name, self._profile = name, profile
        self.down.change(profile.down, now)
        self.up.change(profile.up, now)
        self._begin()

    def cut(self, now: int) -> None:
        """Lose every message on the link, and every message that enters until `restore`."""
        self.changes += 1
        self.down.cut(now)
        self.up.cut(now)

    def restore(self, now: int) -> None:
        self.changes += 1
        self.down.restore(now)
        self.up.restore(now)

    # Telemetry rate control.

    def admits_up(self, key: str, size: int, now: int) -> bool:
        """May this message of `size` bytes go up, or is its topic thinned out?"""
        return self._rate_control.admits(key, size + self._profile.up.overhead_bytes, now)

    def judge(self, now: int) -> bool:
        """Check the upward direction since the last call. True: the rates have changed."""
        carried, busy = self._judged
        self._judged = (self.up.carried_bytes, self.up.busy_ns)
        if not self._thins:
            return False
        took = self.up.busy_ns - busy
        carries = (self.up.carried_bytes - carried) * 8e6 / took if took > 0 else None
        return self._rate_control.judge(carries, now)

    def _begin(self) -> None:
        """Another model is in force."""
        self._rate_control.rates = {}
        if self._thins:
            self._rate_control.begin()

    @property
    def _thins(self) -> bool:
        return self._profile.thin and self._profile.up.rate_kbit > 0.0

    @property
    def thinned(self) -> dict[str, float]:
        """[1/s] Topics that are thinned out, and to what rate."""
        return self._rate_control.rates

    @property
    def telemetry(self) -> str:
        """The same in words."""
        rates = ", ".join(f"{key} {hz:.3g}/s" for key, hz in self.thinned.items())
        return f"telemetry thinned out to {rates}" if rates else "full telemetry"

    # Status.

    def status(self, now: int, clock: Clock | None) -> LinkStatus:
        """What passed since the last status; None where nothing is known."""
        down, up = self.down.report(now), self.up.report(now, dict(self.thinned))
        there = self.down.is_up(now) and self.up.is_up(now)
        one_way = down.delay_p50_ms, up.delay_p50_ms
        known = there and one_way[0] is not None and one_way[1] is not None
        return LinkStatus(
            stamp_ns=now,
            profile=self.name,
            up=there,
            down_link=down,
            up_link=up,
            rtt_ms=(one_way[0] or 0.0) + (one_way[1] or 0.0) if known else None,
            changes=self.changes,
            clock=clock,
        )
