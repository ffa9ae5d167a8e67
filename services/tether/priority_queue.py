"""Priority queue of a link of limited rate: the most urgent packet is sent first."""

from collections import deque
from typing import Generic, NamedTuple, TypeVar

from messages import events
from messages.events import Row
from messages.topic import Qos
from services.tether.profile import Queue

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
