"""The link as a model: when does a message that enters now come out at the other end?

Pure and seeded; time is an argument. Order is kept, as on any cable or single radio hop: a
message never overtakes the one before it.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Annotated, Generic, TypeVar

import msgspec
import numpy as np

from messages.link import Direction

T = TypeVar("T")
Milliseconds = Annotated[float, msgspec.Meta(ge=0.0, le=60_000.0)]


class Leg(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One direction of the link."""

    delay_ms: Milliseconds = 0.0  # [ms] shortest one-way delay
    jitter_ms: Milliseconds = 0.0  # [ms] mean of the exponential part on top of it


class LinkProfile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file of deploy/links/."""

    about: str = ""
    down: Leg = Leg()  # topside to drone
    up: Leg = Leg()  # drone to topside


@dataclass(slots=True)
class Line(Generic[T]):
    """One direction: what is on the way, and what has passed since the last report."""

    leg: Leg
    random: np.random.Generator
    capacity: int = 4096  # messages on the way; more are dropped, newest first to go
    forwarded: int = 0
    dropped: int = 0
    _queue: deque[tuple[int, int, T]] = field(default_factory=deque[tuple[int, int, T]])
    _delays: list[int] = field(default_factory=list[int])

    def enter(self, item: T, now: int) -> bool:
        """A message enters at `now` [ns]. False: the line is full and the message is lost."""
        if len(self._queue) >= self.capacity:
            self.dropped += 1
            return False
        out = now + self._delay_ns()
        if self._queue:
            out = max(out, self._queue[-1][0])
        self._queue.append((out, now, item))
        return True

    def due(self) -> int | None:
        """[ns] When the next message comes out."""
        return self._queue[0][0] if self._queue else None

    def leave(self, now: int) -> T | None:
        """The next message that has come out by `now`, or None."""
        if not self._queue or self._queue[0][0] > now:
            return None
        _, entered, item = self._queue.popleft()
        self.forwarded += 1
        self._delays.append(now - entered)
        return item

    def report(self) -> Direction:
        """What passed since the last report; the period starts anew."""
        delays = sorted(self._delays)
        self._delays = []
        return Direction(
            delay_p50_ms=_percentile_ms(delays, 50),
            delay_p99_ms=_percentile_ms(delays, 99),
            forwarded=self.forwarded,
            dropped=self.dropped,
            queued=len(self._queue),
        )

    def _delay_ns(self) -> int:
        jitter = self.random.exponential(self.leg.jitter_ms) if self.leg.jitter_ms > 0 else 0.0
        return round((self.leg.delay_ms + jitter) * 1e6)


def _percentile_ms(ordered: list[int], percent: int) -> float | None:
    return ordered[len(ordered) * percent // 100] / 1e6 if ordered else None
