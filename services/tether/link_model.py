"""One direction of the link: what becomes of a message that enters now?

Pure and seeded; time is an argument, and when the questions are asked does not matter. A message
waits for its turn where the rate is limited, leaves, and then either is lost or arrives after its
delay. Order is kept, as on any cable or single radio hop, except where the profile says that some
come late; the waiting room lets the urgent pass the patient.
"""

from collections import Counter
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Generic, TypeVar

import numpy as np

from messages.link import Direction
from services.tether.delay import Constant, Delays, Exponential, Trace
from services.tether.loss import Losses
from services.tether.priority_queue import Packet, PriorityQueue
from services.tether.profile import DirectionProfile, Queue
from services.tether.random_streams import streams

T = TypeVar("T")
MOST = 16_384  # messages on the way; more are lost, whatever the profile says
IN_THE_QUEUE = ("queue_full", "codel")  # reasons that mean: more than the link can carry


@dataclass(frozen=True, slots=True)
class Arrival(Generic[T]):
    item: T
    damaged: bool


class LinkDirection(Generic[T]):
    """Messages of any type; `Direction.lost` has a key for every reason."""

    def __init__(
        self, leg: DirectionProfile, random: np.random.Generator, most: int = MOST
    ) -> None:
        self.lost: Counter[str] = Counter()  # by reason, since start
        self.entered = self.forwarded = self.copied = 0  # messages since start
        self.carried_bytes = 0  # since start, overhead included
        self._streams = streams(random)
        self._most = most
        self._clock = 0  # [ns] latest moment that was asked about
        self._flying: list[tuple[int, int, int, bool, T]] = []  # heap: out, count, entered, …
        self._numbered = 0  # breaks ties in the heap
        self._last_out = 0  # [ns] nobody arrives before it
        self._leaving: tuple[int, Packet[T]] | None = None  # [ns] when it has left, and who
        self._least_waiting = 0  # [B] since it was asked for
        self._newly_lost: list[tuple[T, str]] = []
        self._delays: list[int] = []  # [ns] of the period
        self._before = ReportPeriod()
        self._is_cut = False
        self._began: int | None = None  # [ns] schedules count from here: the first message
        self._set(leg)

    # What passes.

    def enter(self, item: T, now: int, size: int = 0, rank: int = 0) -> None:
        """A message of `size` bytes enters at `now` [ns]; `rank` is its stance's urgency."""
        self._advance(now)
        self._began = now if self._began is None else self._began
        self.entered += 1
        packet = Packet(item, size + self._leg.overhead_bytes, rank, now)
        if self._is_cut:
            self._lose(item, "outage")
        elif self.on_the_way >= self._most:
            self._lose(item, "too_many")
        elif self._leg.rate_kbit == 0.0:
            self._depart(packet, self._clock)
        else:
            self._lose_all(self._waiting.put(packet))
            if self._leaving is None:
                self._next(self._clock)

    def due(self) -> int | None:
        """[ns] When something happens next: a message arrives, or the next one may leave."""
        times = [self._flying[0][0]] if self._flying else []
        if self._leaving is not None:
            times.append(self._leaving[0])
        return min(times, default=None)

    def leave(self, now: int) -> Arrival[T] | None:
        """The next message that has arrived by `now`, or None."""
        self._advance(now)
        if not self._flying or self._flying[0][0] > now:
            return None
        _, _, entered, damaged, item = heappop(self._flying)
        self.forwarded += 1
        self._delays.append(max(0, now - entered))
        return Arrival(item, damaged)

    def take_lost(self) -> list[tuple[T, str]]:
        """What was lost since this was asked last, with the reason."""
        lost, self._newly_lost = self._newly_lost, []
        return lost

    @property
    def on_the_way(self) -> int:
        return len(self._flying) + len(self._waiting) + (self._leaving is not None)

    # What changes.

    def change(self, leg: DirectionProfile, now: int) -> None:
        """Another model from now on; what is on the way stays on its way."""
        self._advance(now)
        waiting = self._waiting.empty()
        self._set(leg)
        self._began = self._clock
        if leg.rate_kbit > 0.0:
            for packet in waiting:
                self._waiting.admit(packet)
            if self._leaving is None:
                self._next(self._clock)
            return
        if self._leaving is not None:
            waiting.insert(0, self._leaving[1])
            self._leaving = None
        for packet in waiting:
            self._depart(packet, self._clock)

    def cut(self, now: int) -> None:
        """The link is gone: whatever is on the way is lost, and whatever enters."""
        self._advance(now)
        self._is_cut = True
        self._lose_all([(p.item, "outage") for p in self._waiting.empty()])
        if self._leaving is not None:
            self._lose(self._leaving[1].item, "outage")
            self._leaving = None
        self._lose_all([(flight[4], "outage") for flight in sorted(self._flying)])
        self._flying.clear()

    def restore(self, now: int) -> None:
        self._advance(now)
        self._is_cut = False

    # What is known.

    def is_up(self, now: int) -> bool:
        """Would a message that leaves at `now` have a chance?"""
        at = self._seconds(now)
        return not self._is_cut and not self._leg.outages.touch(at, at)

    def standing_bytes(self, now: int) -> int:
        """[B] Least that has waited at any moment since this was asked last: what is in the queue
        for longer than a burst."""
        self._advance(now)
        standing = min(self._least_waiting, self._waiting.bytes)
        self._least_waiting = self._waiting.bytes
        return standing

    @property
    def lost_in_queue(self) -> int:
        return sum(self.lost[reason] for reason in IN_THE_QUEUE)

    def report(self, now: int, tiers: dict[str, float] | None = None) -> Direction:
        """What passed since the last report; the period starts anew."""
        self._advance(now)
        here = ReportPeriod(now, self.forwarded, self.lost.total(), self.carried_bytes)
        seconds = 0.0 if self._before.at is None else (now - self._before.at) / 1e9
        lost = here.lost - self._before.lost
        settled = lost + here.forwarded - self._before.forwarded
        kilobits = (here.bytes - self._before.bytes) * 8e-3
        delays, self._delays, self._before = sorted(self._delays), [], here
        there = self.is_up(now)
        return Direction(
            delay_p50_ms=_percentile_ms(delays, 50) if there else None,
            delay_p99_ms=_percentile_ms(delays, 99) if there else None,
            forwarded=here.forwarded,
            dropped=here.lost,
            queued=self.on_the_way,
            lost=dict(self.lost),
            loss=lost / settled if settled else None,
            rate_kbit=kilobits / seconds if seconds > 0.0 else 0.0,
            tiers=tiers or {},
        )

    # How it goes.

    def _set(self, leg: DirectionProfile) -> None:
        self._leg = leg
        self._waiting: PriorityQueue[T] = PriorityQueue(leg.queue or Queue())
        self._losses = Losses(leg.loss, self._streams.loss)
        self._trace = leg.delay if isinstance(leg.delay, Trace) else None
        spread = Constant() if isinstance(leg.delay, Trace) else leg.delay
        self._spread = Delays(spread or Exponential(leg.jitter_ms), self._streams.delay)

    def _advance(self, now: int) -> None:
        """Let leave whoever has left by `now`, each at its own time."""
        self._clock = max(self._clock, now)
        while self._leaving is not None and self._leaving[0] <= self._clock:
            at, packet = self._leaving
            self._depart(packet, at)
            self._next(at)

    def _next(self, at: int) -> None:
        """The link is free at `at` [ns]: whose turn is it?"""
        packet, dropped = self._waiting.take(at)
        self._lose_all(dropped)
        self._least_waiting = min(self._least_waiting, self._waiting.bytes)
        self._leaving = None
        if packet is not None:
            takes = packet.size * 8e6 / self._leg.rate_kbit  # [ns]
            self._leaving = (at + round(takes), packet)

    def _depart(self, packet: Packet[T], at: int) -> None:
        """A message has left at `at` [ns]: its fate is decided now."""
        self.carried_bytes += packet.size
        delay = self._delay_ns(at)
        reason = "trace" if delay is None else self._losses.reason(self._seconds(at))
        damaged = self._streams.damage.happens(self._leg.corrupt)
        copies = 1 + self._streams.copy.happens(self._leg.duplicate)
        late = self._leg.late
        if late is not None and self._streams.late.happens(late.share):
            held = round(late.ms * 1e6)
        else:
            held = 0
        if delay is None or reason is not None:
            self._lose(packet.item, reason or "trace")
            return
        out = max(at + delay, self._last_out) + held
        if self._leg.outages.touch(self._seconds(at), self._seconds(out)):
            self._lose(packet.item, "outage")
            return
        if not held:
            self._last_out = out
        self.copied += copies - 1
        for _ in range(copies):
            self._numbered += 1
            flight = (out, self._numbered, packet.entered, damaged, packet.item)
            heappush(self._flying, flight)

    def _delay_ns(self, at: int) -> int | None:
        """None: the trace says that it is lost."""
        more = self._trace.at(self._seconds(at)) if self._trace else self._spread.next_ms()
        return None if more is None else round((self._leg.delay_ms + more) * 1e6)

    def _seconds(self, now: int) -> float:
        """[s] since the link began."""
        return 0.0 if self._began is None else (now - self._began) / 1e9

    def _lose(self, item: T, reason: str) -> None:
        self.lost[reason] += 1
        self._newly_lost.append((item, reason))

    def _lose_all(self, lost: list[tuple[T, str]]) -> None:
        for item, reason in lost:
            self._lose(item, reason)


@dataclass(frozen=True, slots=True)
class ReportPeriod:
    """Counts since start, as they were at the last report."""

    at: int | None = None  # [ns] None: there was none
    forwarded: int = 0
    lost: int = 0
    bytes: int = 0


def _percentile_ms(ordered: list[int], percent: int) -> float | None:
    return ordered[len(ordered) * percent // 100] / 1e6 if ordered else None
