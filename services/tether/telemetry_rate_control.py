"""Telemetry rate control: reduces telemetry rates when the link cannot carry all of it.

Simulator ground truth is throttled first, vehicle state last. A pure controller on measurements of
the upward direction. Events and slow topics are never throttled. Nothing on the topside controls
the vehicle by the throttled topics; on board they keep their full rate.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from messages import topics
from services.marine.summation import plain_sum

COLUMNS = (
    topics.TRUTH, topics.WRENCH, topics.ACTUATION, topics.THRUSTERS, topics.REFERENCE, topics.STATE,
)  # fmt: skip
LADDER = (
    # [1/s] at most, level by level; columns as above, the least important first
    (100, 100, 100, 100, 100, 100),
    (20, 100, 100, 100, 100, 100),
    (5, 50, 50, 100, 100, 100),
    (5, 20, 20, 50, 100, 100),
    (2, 10, 10, 20, 50, 100),
    (1, 5, 5, 10, 25, 50),
    (1, 2, 2, 5, 20, 40),
    (1, 2, 2, 5, 10, 25),
    (1, 1, 1, 2, 5, 10),
    (1, 1, 1, 1, 1, 5),
)
WORST = len(LADDER) - 1
LONG_WAIT_S = 0.06  # [s] to empty the queue: above this the link is overloaded
SHORT_WAIT_S = 0.02  # [s] to empty the queue: below this there is spare capacity
SHRINKING = 0.95  # [-] of the queue at the last check: below this it is shrinking
ROOM = 0.85  # [-] share of the measured capacity that may be used
SETTLE_NS = 1_000_000_000  # [ns] after a change, before its effect is judged
PATIENCE_NS = 3_000_000_000  # [ns] of spare capacity before a higher rate that should fit is tried
DOUBT_NS = 15_000_000_000  # [ns] the same, for a rate that did not fit the last time
MOST_DOUBT_NS = 120_000_000_000  # [ns] the same, after many failed trials


def limits(level: int) -> dict[str, float]:
    """[1/s] Topics that are throttled at a level, and to what rate."""
    rates = zip(COLUMNS, LADDER[level], strict=True)
    return {topic.key: float(hz) for topic, hz in rates if hz < topic.hz}


@dataclass(slots=True)
class RateLadder:
    """The level of `LADDER` in force, and the conditions for changing it."""

    level: int = 0
    capacity_kbit: float | None = None  # [kbit/s] carried when it was last overloaded
    _settled_at: int = 0  # [ns] not judged before
    _standing: int = 0  # [B] at the last check
    _roomy_since: int | None = None  # [ns]
    _doubt: int = DOUBT_NS  # [ns]
    _was_trial: bool = False  # the last change was to a level that had not fitted

    def judge(
        self, standing: int, lost: int, carried_kbit: float, offered: Mapping[str, float], now: int
    ) -> bool:
        """Check the last period. Returns whether the level has changed.

        Args:
            standing: [B] shortest queue of the period: a burst alone is no overload.
            lost: messages lost because the queue was too long.
            carried_kbit: [kbit/s]
            offered: [kbit/s] load of each topic at its full rate; `""` is the sum of all topics
                that are never throttled.
        """
        shrinks, self._standing = standing < SHRINKING * self._standing, standing
        if now < self._settled_at:
            return False
        rate = max(carried_kbit, self.capacity_kbit or 0.0)  # an idle link carries less than it can
        wait = standing * 8e-3 / rate if rate > 0.0 else float(standing)  # [s]
        if lost > 0 or (wait > LONG_WAIT_S and not shrinks):
            return self._worse(carried_kbit, offered, now)
        if wait > SHORT_WAIT_S:
            self._roomy_since = None
            return False
        return self._better(offered, now)

    def _worse(self, carried_kbit: float, offered: Mapping[str, float], now: int) -> bool:
        """Reduce the rates at once to what the capacity just measured can carry."""
        self._roomy_since = None
        self.capacity_kbit = carried_kbit
        if self.level == WORST:
            return False
        if self._was_trial:
            self._doubt = min(2 * self._doubt, MOST_DOUBT_NS)
        self.level += 1
        while self.level < WORST and load_kbit(self.level, offered) > ROOM * carried_kbit:
            self.level += 1
        self._settled_at, self._was_trial = now + SETTLE_NS, False
        return True

    def _better(self, offered: Mapping[str, float], now: int) -> bool:
        """One level up after enough time with spare capacity."""
        if self._roomy_since is None:
            self._roomy_since = now
        if self.level == 0:
            return False
        fits = load_kbit(self.level - 1, offered) <= ROOM * (self.capacity_kbit or 0.0)
        if now - self._roomy_since < (PATIENCE_NS if fits else self._doubt):
            return False
        if self._was_trial and not fits:  # the trial before this one succeeded: the link is better
            self._doubt = PATIENCE_NS
        self.level -= 1
        self._roomy_since, self._was_trial = now, not fits
        return True


def load_kbit(level: int, offered: Mapping[str, float]) -> float:
    """[kbit/s] Load of the link at a level."""
    capped = limits(level)
    return plain_sum(
        kilobits * (capped[topic] / FULL[topic] if topic in capped else 1.0)
        for topic, kilobits in offered.items()
    )


FULL = {topic.key: topic.hz for topic in COLUMNS}


@dataclass(slots=True)
class TelemetryRateControl:
    """Throttles topics to given rates, and measures the load that was offered."""

    rates: dict[str, float] = field(default_factory=dict[str, float])  # [1/s] by key
    _due: dict[str, int] = field(default_factory=dict[str, int])  # [ns]
    _bytes: dict[str, int] = field(default_factory=dict[str, int])  # of the period
    _since: int | None = None  # [ns]

    def admits(self, key: str, size: int, now: int) -> bool:
        """May this message of `size` bytes be sent?"""
        if key == topics.VIDEO.key:  # less urgent than telemetry, and follows the link by itself
            return True
        if self._since is None:
            self._since = now
        name = key if key in FULL else ""
        self._bytes[name] = self._bytes.get(name, 0) + size
        if (hz := self.rates.get(key)) is None:
            return True
        period = round(1e9 / hz)
        due = self._due.get(key, now)
        if now < due:
            return False
        self._due[key] = max(due, now - period) + period
        return True

    def offered(self, now: int) -> dict[str, float]:
        """[kbit/s] Load by key since the last call; a new period begins."""
        seconds = 0.0 if self._since is None else (now - self._since) / 1e9
        total, self._bytes, self._since = self._bytes, {}, now
        if seconds <= 0.0:
            return {}
        return {key: count * 8e-3 / seconds for key, count in total.items()}
