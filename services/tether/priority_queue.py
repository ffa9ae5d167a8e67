"""Priority queue of a link of limited rate: the most urgent packet is sent first."""

from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

from messages.topic import Qos
from services.tether.codel import Dropper
from services.tether.profile import Queue

T = TypeVar("T")
# Strict priority. Events are few, and telemetry would starve them.
URGENCY = (Qos.REALTIME, Qos.EVENT, Qos.LIVE, Qos.BULK)
DROPPED_FIRST = (Qos.BULK, Qos.LIVE, Qos.EVENT, Qos.REALTIME)  # when the queue is full
RANK = {qos: rank for rank, qos in enumerate(URGENCY)}
Lost = list[tuple[T, str]]  # dropped items, and why


@dataclass(frozen=True, slots=True)
class Packet(Generic[T]):
    item: T
    size: int  # [B] with overhead
    rank: int  # index in URGENCY
    entered: int  # [ns]


class PriorityQueue(Generic[T]):
    """One queue for each QoS profile, one size limit for all of them together."""

    def __init__(self, queue: Queue) -> None:
        self._queue = queue
        self._rows: list[deque[Packet[T]]] = [deque() for _ in URGENCY]
        self._droppers = [Dropper(queue.codel) for _ in URGENCY]
        self.bytes = 0

    def __len__(self) -> int:
        return sum(map(len, self._rows))

    def put(self, packet: Packet[T]) -> Lost[T]:
        """Enqueue a packet; returns those evicted, possibly this one."""
        lost: Lost[T] = []
        self.admit(packet)
        while self.bytes > self._queue.limit_bytes:
            lost.append((self._evict().item, "queue_full"))
        return lost

    def admit(self, packet: Packet[T]) -> None:
        """Enqueue a packet whatever the limit: it was in the queue before the limit changed."""
        self._rows[packet.rank].append(packet)
        self.bytes += packet.size

    def take(self, now: int) -> tuple[Packet[T] | None, Lost[T]]:
        """The next packet to send at `now` [ns], and those that CoDel dropped before it."""
        lost: Lost[T] = []
        for row, dropper in zip(self._rows, self._droppers, strict=True):
            while row:
                packet = row.popleft()
                self.bytes -= packet.size
                waited = now - packet.entered
                if self._queue.policy == "codel" and dropper.drops(waited, not row, now):
                    lost.append((packet.item, "codel"))
                    continue
                return packet, lost
        return None, lost

    def empty(self) -> list[Packet[T]]:
        """Remove and return all packets, the most urgent first."""
        packets = [packet for row in self._rows for packet in row]
        for row in self._rows:
            row.clear()
        self.bytes = 0
        return packets

    def _evict(self) -> Packet[T]:
        """Remove a packet of the least urgent QoS profile: the newest, or by policy the oldest."""
        row = next(row for qos in DROPPED_FIRST if (row := self._rows[RANK[qos]]))
        evicted = row.popleft() if self._queue.policy == "drop_oldest" else row.pop()
        self.bytes -= evicted.size
        return evicted
