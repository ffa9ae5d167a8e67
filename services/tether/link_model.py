"""Model of one direction of the link: delay, loss, damage and queueing of each message.

Pure and seeded; time is an argument, and the result does not depend on when it is called. Where
the rate is limited, a message waits in the priority queue; it is then sent, and either is lost or
arrives after its delay. Messages keep their order, as on a cable or a single radio hop, except
where the profile delays some of them, and except that the queue sends urgent messages first.
"""

import math
import sys
from collections import Counter, deque
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from messages import events
from messages.events import Row
from messages.link import DirectionReport
from messages.topic import Qos
from services.tether.profile import (
    Delays,
    DirectionProfile,
    Exponential,
    Losses,
    Queue,
    Trace,
    UniformStream,
)

# Priority queue of a link of limited rate: the most urgent packet is sent first.


T = TypeVar("T")
# Strict priority. Events are few, and telemetry would starve them.
URGENCY = (Qos.REALTIME, Qos.EVENT, Qos.LIVE, Qos.BULK)
DROPPED_FIRST = (Qos.BULK, Qos.LIVE, Qos.EVENT, Qos.REALTIME)  # when the queue is full
RANK = {qos: rank for rank, qos in enumerate(URGENCY)}
Lost = list[tuple[T, Row]]  # dropped items, and why


class Packet(NamedTuple, Generic[T]):
    item: T
    size: int  # [B] with overhead
    rank: int  # index in URGENCY
    entered: int  # [ns]
    life: int | None = None  # [ns] after that it is useless, and not sent; None: it waits


class PriorityQueue(Generic[T]):
    """One queue for each QoS profile, one size limit for all of them together."""

    def __init__(self, queue: Queue) -> None:
        self._queue = queue
        self._rows: list[deque[Packet[T]]] = [deque() for _ in URGENCY]
        self.packets = self.bytes = 0

    def put(self, packet: Packet[T]) -> Lost[T]:
        """Enqueue a packet; returns those evicted, possibly this one."""
        lost: Lost[T] = []
        self.admit(packet)
        while self.bytes > self._queue.limit_bytes:
            evicted = self._evict()
            why = events.QUEUE_FULL if evicted.life is None else events.NO_ROOM
            lost.append((evicted.item, why))
        return lost

    def admit(self, packet: Packet[T]) -> None:
        """Enqueue a packet whatever the limit: it was in the queue before the limit changed."""
        self._rows[packet.rank].append(packet)
        self._add(packet, 1)

    def take(self, now: int) -> tuple[Packet[T] | None, Lost[T]]:
        """The next packet to send at `now` [ns], and those before it that have become useless."""
        lost: Lost[T] = []
        for row in self._rows:
            while row:
                packet = row.popleft()
                self._add(packet, -1)
                if packet.life is None or now - packet.entered <= packet.life:
                    return packet, lost
                lost.append((packet.item, events.NO_ROOM))
        return None, lost

    def empty(self) -> list[Packet[T]]:
        """Remove and return all packets, the most urgent first."""
        packets = [packet for row in self._rows for packet in row]
        for row in self._rows:
            row.clear()
        self.packets = self.bytes = 0
        return packets

    def _evict(self) -> Packet[T]:
        """Remove a packet of the least urgent QoS profile: the newest, or by policy the oldest."""
        row = next(row for qos in DROPPED_FIRST if (row := self._rows[RANK[qos]]))
        evicted = row.popleft() if self._queue.policy == "drop_oldest" else row.pop()
        self._add(evicted, -1)
        return evicted

    def _add(self, packet: Packet[T], sign: int) -> None:
        self.packets += sign
        self.bytes += sign * packet.size


MOST_ON_THE_WAY = 16_384  # messages on the link; more are lost, whatever the profile


class Arrival(NamedTuple, Generic[T]):
    item: T
    damaged: bool


class LinkDirection(Generic[T]):
    """Messages of any type; `DirectionReport.lost` has a key for every reason."""

    def __init__(
        self, profile: DirectionProfile, random: np.random.Generator, most: int = MOST_ON_THE_WAY
    ) -> None:
        self.lost: Counter[str] = Counter()  # by reason, since start
        self.entered = self.forwarded = self.copied = 0  # messages since start
        self.carried_bytes = 0  # since start, overhead included
        self.busy_ns = 0  # [ns] since start, in which a limited rate carried them
        # A stream for each purpose: the same seed loses the same messages, whatever the delays are.
        self._of_delays, *others = random.spawn(5)
        self._of_loss, self._of_late, self._of_copies, self._of_damage = map(UniformStream, others)
        self._most = most
        self._clock = 0  # [ns] latest `now` so far
        # Heap of (arrival [ns], number, entered [ns], damaged, item).
        self._in_flight: list[tuple[int, int, int, bool, T]] = []
        self._numbered = 0  # breaks ties in the heap
        self._last_arrival = 0  # [ns] no message arrives before it, so that the order is kept
        self._sending: tuple[int, Packet[T]] | None = None  # [ns] when it has been sent
        self._newly_lost: list[tuple[T, Row]] = []
        self._delays: list[int] = []  # [ns] of the period
        self._before = ReportPeriod()
        self._is_cut = False
        self._began: int | None = None  # [ns] first message; schedules count from here
        self._set(profile)

    # Messages.

    def enter(
        self, item: T, now: int, size: int = 0, rank: int = 0, life: int | None = None
    ) -> None:
        """A message of `size` bytes enters at `now` [ns]; `rank` as in `priority_queue.RANK`,
        `life` as in a `Packet`."""
        self._advance(now)
        if self._began is None:
            self._began = now
        self.entered += 1
        packet = Packet(item, size + self._profile.overhead_bytes, rank, now, life)
        if self._is_cut:
            self._lose(item, events.OUTAGE)
        elif self.on_the_way >= self._most:
            self._lose(item, events.TOO_MANY)
        elif self._profile.rate_kbit == 0.0:
            self._depart(packet, self._clock)
        else:
            self._lose_all(self._waiting.put(packet))
            if self._sending is None:
                self._next(self._clock)

    def due(self) -> int | None:
        """[ns] When a message arrives or the next one can be sent; None: there is none."""
        arrives = self._in_flight[0][0] if self._in_flight else None
        if self._sending is None:
            return arrives
        sent = self._sending[0]
        return sent if arrives is None else min(sent, arrives)

    def leave(self, now: int) -> Arrival[T] | None:
        """The next message that has arrived by `now`, or None."""
        if now > self._clock:
            self._clock = now
        if self._sending is not None:
            self._advance(now)
        if not self._in_flight or self._in_flight[0][0] > now:
            return None
        _, _, entered, damaged, item = heappop(self._in_flight)
        self.forwarded += 1
        self._delays.append(max(0, now - entered))
        return Arrival(item, damaged)

    def take_lost(self) -> list[tuple[T, Row]]:
        """Messages lost since the last call, with the reason."""
        lost, self._newly_lost = self._newly_lost, []
        return lost

    @property
    def has_lost(self) -> bool:
        """Is there anything for `take_lost`?"""
        return bool(self._newly_lost)

    @property
    def on_the_way(self) -> int:
        return len(self._in_flight) + self._waiting.packets + (self._sending is not None)

    # Changes.

    def change(self, profile: DirectionProfile, now: int) -> None:
        """Use another model from now on; messages on the link still arrive."""
        self._advance(now)
        waiting = self._waiting.empty()
        self._set(profile)
        self._began = self._clock
        if profile.rate_kbit > 0.0:
            for packet in waiting:
                self._waiting.admit(packet)
            if self._sending is None:
                self._next(self._clock)
            return
        if self._sending is not None:
            waiting.insert(0, self._sending[1])
            self._sending = None
        for packet in waiting:
            self._depart(packet, self._clock)

    def cut(self, now: int) -> None:
        """Interrupt the link: lose every message on it, and every message that enters."""
        self._advance(now)
        self._is_cut = True
        self._lose_all([(p.item, events.OUTAGE) for p in self._waiting.empty()])
        if self._sending is not None:
            self._lose(self._sending[1].item, events.OUTAGE)
            self._sending = None
        self._lose_all([(entry[4], events.OUTAGE) for entry in sorted(self._in_flight)])
        self._in_flight.clear()

    def restore(self, now: int) -> None:
        self._advance(now)
        self._is_cut = False

    # State and report.

    def is_up(self, now: int) -> bool:
        """Is the link free of cuts and outages at `now` [ns]?"""
        at = self._seconds(now)
        return not self._is_cut and not self._profile.outages.touch(at, at)

    def report(self, now: int, tiers: dict[str, float] | None = None) -> DirectionReport:
        """Report of the period since the last report; a new period begins."""
        self._advance(now)
        here = ReportPeriod(now, self.forwarded, self.lost.total(), self.carried_bytes)
        seconds = 0.0 if self._before.at is None else (now - self._before.at) / 1e9
        lost = here.lost - self._before.lost
        settled = lost + here.forwarded - self._before.forwarded
        kilobits = (here.bytes - self._before.bytes) * 8e-3
        delays, self._delays, self._before = sorted(self._delays), [], here
        there = self.is_up(now)
        return DirectionReport(
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

    # Internals.

    def _set(self, profile: DirectionProfile) -> None:
        self._profile = profile
        self._waiting: PriorityQueue[T] = PriorityQueue(profile.queue or Queue())
        self._losses = Losses(profile.loss, self._of_loss)
        self._trace = profile.delay if isinstance(profile.delay, Trace) else None
        spread = None if isinstance(profile.delay, Trace) else profile.delay
        self._spread = Delays(spread or Exponential(profile.jitter_ms), self._of_delays)

    def _advance(self, now: int) -> None:
        """Send every packet that is sent by `now`, each at its own time."""
        if now > self._clock:
            self._clock = now
        while self._sending is not None and self._sending[0] <= self._clock:
            at, packet = self._sending
            self.busy_ns += self._takes_ns(packet)
            self._depart(packet, at)
            self._next(at)

    def _next(self, at: int) -> None:
        """The link is free at `at` [ns]: start to send the next packet."""
        packet, useless = self._waiting.take(at)
        self._lose_all(useless)
        self._sending = None
        if packet is not None:
            self._sending = (at + self._takes_ns(packet), packet)

    def _takes_ns(self, packet: Packet[T]) -> int:
        return round(packet.size * 8e6 / self._profile.rate_kbit)

    def _depart(self, packet: Packet[T], at: int) -> None:
        """A packet was sent at `at` [ns]: decide loss, damage, copies and arrival."""
        self.carried_bytes += packet.size
        profile = self._profile
        more = self._trace.at(self._seconds(at)) if self._trace else self._spread.next_ms()
        delay = None if more is None else round((profile.delay_ms + more) * 1e6)  # [ns]
        reason = events.TRACE if delay is None else self._losses.reason()
        damaged = self._of_damage.happens(profile.corrupt)
        copies = 1 + self._of_copies.happens(profile.duplicate)
        late, held = profile.late, 0
        if late is not None and self._of_late.happens(late.share):
            held = round(late.ms * 1e6)
        if delay is None or reason is not None:
            self._lose(packet.item, reason or events.TRACE)
            return
        arrival = max(at + delay, self._last_arrival) + held
        outages = profile.outages
        if outages.windows and outages.touch(self._seconds(at), self._seconds(arrival)):
            self._lose(packet.item, events.OUTAGE)
            return
        if not held:
            self._last_arrival = arrival
        self.copied += copies - 1
        for _ in range(copies):
            self._numbered += 1
            entry = (arrival, self._numbered, packet.entered, damaged, packet.item)
            heappush(self._in_flight, entry)

    def _seconds(self, now: int) -> float:
        """[s] since the link began."""
        return 0.0 if self._began is None else (now - self._began) / 1e9

    def _lose(self, item: T, reason: Row) -> None:
        self.lost[reason.name] += 1
        self._newly_lost.append((item, reason))

    def _lose_all(self, lost: list[tuple[T, Row]]) -> None:
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


FateRow = tuple[int, float, float | None, str]  # seq, sent [s], arrived [s], reason


def fates(
    leg: DirectionProfile, rate: float, size: int, seconds: float, seed: int
) -> list[FateRow]:
    """What becomes of each of a stream of messages, by seq; one row per copy."""
    line: LinkDirection[int] = LinkDirection(leg, np.random.default_rng(seed))
    entries = [round(n * 1e9 / rate) for n in range(max(1, math.floor(rate * seconds)))]
    rows: list[FateRow] = []

    def settle(now: int) -> None:
        while (due := line.due()) is not None and due <= now:
            while (arrival := line.leave(due)) is not None:
                why = events.DAMAGED.name if arrival.damaged else ""
                rows.append((arrival.item, entries[arrival.item] / 1e9, due / 1e9, why))

    for number, entered in enumerate(entries):
        settle(entered)
        line.enter(number, entered, size)
    settle(sys.maxsize)
    rows += [(number, entries[number] / 1e9, None, why.name) for number, why in line.take_lost()]
    return sorted(rows, key=lambda row: (row[0], row[2] or 0.0))
