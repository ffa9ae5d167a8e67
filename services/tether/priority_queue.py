"""What waits for a link of limited rate: the most urgent goes first."""

from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

from messages.topic import Qos
from services.tether.codel import Dropper
from services.tether.profile import Queue

T = TypeVar("T")
# Strict: the first that has something. Events are few, and telemetry would starve them.
URGENCY = (Qos.REALTIME, Qos.EVENT, Qos.LIVE, Qos.BULK)
GIVES_WAY = (Qos.BULK, Qos.LIVE, Qos.EVENT, Qos.REALTIME)  # when full: the least missed first
RANK = {qos: rank for rank, qos in enumerate(URGENCY)}
Lost = list[tuple[T, str]]  # what was lost, and why


@dataclass(frozen=True, slots=True)
class Packet(Generic[T]):
    item: T
    size: int  # [B] with overhead
    rank: int  # place in URGENCY
    entered: int  # [ns]


class PriorityQueue(Generic[T]):
    """One queue for each stance, one limit for all of them together."""

    def __init__(self, queue: Queue) -> None:
        self._queue = queue
        self._rows: list[deque[Packet[T]]] = [deque() for _ in URGENCY]
        self._droppers = [Dropper(queue.codel) for _ in URGENCY]
        self.bytes = 0

    def __len__(self) -> int:
        return sum(map(len, self._rows))

    def put(self, packet: Packet[T]) -> Lost[T]:
        """Let one in; returns who had to go for it, perhaps itself."""
        lost: Lost[T] = []
        self.admit(packet)
        while self.bytes > self._queue.limit_bytes:
            lost.append((self._push_out().item, "queue_full"))
        return lost

    def admit(self, packet: Packet[T]) -> None:
        """Let one in whatever the limit says: it was waiting before the limit changed."""
        self._rows[packet.rank].append(packet)
        self.bytes += packet.size

    def take(self, now: int) -> tuple[Packet[T] | None, Lost[T]]:
        """The next to leave at `now` [ns], and those that CoDel dropped before it."""
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
        """Everybody out, the most urgent first."""
        everybody = [packet for row in self._rows for packet in row]
        for row in self._rows:
            row.clear()
        self.bytes = 0
        return everybody

    def _push_out(self) -> Packet[T]:
        """One that is missed least: the newest, or the oldest where the policy says so."""
        row = next(row for qos in GIVES_WAY if (row := self._rows[RANK[qos]]))
        out = row.popleft() if self._queue.policy == "drop_oldest" else row.pop()
        self.bytes -= out.size
        return out
